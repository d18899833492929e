// Sticks and boards much thinner than they are long: they neither gain energy in impacts nor hang in each
// other.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "tests/property/PhysicsFixture.h"

using namespace physics_fixture;
using namespace smartsurf;
using Eigen::Vector3d;

namespace {

class ThinBodies : public testing::TestWithParam<double> {};
INSTANTIATE_TEST_SUITE_P(Steps, ThinBodies, testing::Values(1.0 / 60, 1.0 / 120, 1.0 / 240, 1.0 / 960));

Eigen::AngleAxisd tilted(auto& draw, double most) {
  const double azimuth = draw(0, 2 * std::numbers::pi);
  return {draw(-most, most), Vector3d(std::cos(azimuth), std::sin(azimuth), 0)};
}

// Energy of a body of mass 1 above z = 0, u²/s². `moments`: about the axes of its shape.
double energy_of(const scene::Snapshot& s, std::size_t i, const Vector3d& moments) {
  const auto& q = s.orientation[i];
  const auto vector = [](const auto& v) { return Eigen::Vector3f(v.data()).template cast<double>().eval(); };
  const Vector3d spin =
      Eigen::Quaternionf(q[3], q[0], q[1], q[2]).cast<double>().conjugate() * vector(s.angular_velocity[i]);
  return 0.5 * vector(s.velocity[i]).squaredNorm() + 0.5 * spin.cwiseAbs2().dot(moments) +
         kGravity * static_cast<double>(s.position[i][2]);
}

}  // namespace

// A stick that lands aslant spins about its axis by turns in a step, with a moment a thousandth of the
// others.
TEST_P(ThinBodies, SticksThatLandOnCellsGainNoEnergy) {
  constexpr int kDraws = 40;
  constexpr double kFall_s = 1.6;
  double greatest_gain = 0;
  for_random_fixtures(11, kDraws, GetParam(), [&](PhysicsFixture& fixture, auto& draw) {
    scene::Material& material = fixture.scene.materials[0];
    material.friction = draw(0, 1);
    material.restitution = draw(0, 0.7);
    const double length = draw(1, 3), thickness = length * std::exp(draw(std::log(0.006), std::log(0.08))),
                 height = draw(2, 4), moment = (length * length + thickness * thickness) / 12;
    const bool is_box = draw(0, 1) < 0.6;
    scene::ObjectSpec o = is_box ? box({thickness, thickness, length}, {15, 15, height})
                                 : cylinder(thickness / 2, length, {15, 15, height});
    const Vector3d moments = is_box
                                 ? Vector3d(moment, moment, thickness * thickness / 6)
                                 : Vector3d(moment - thickness * thickness / 48,
                                            moment - thickness * thickness / 48, thickness * thickness / 8);
    o.mass = 1;
    o.orientation = tilted(draw, 1.5);
    fixture.add(o);
    const double at_start = kGravity * height;
    double greatest = 0;
    fixture.run(kFall_s, [&] { greatest = std::max(greatest, energy_of(fixture.snapshot(), 0, moments)); });
    greatest_gain = std::max(greatest_gain, greatest / at_start - 1);
  });
  RecordProperty("greatest_gain", std::to_string(greatest_gain));
  EXPECT_LT(greatest_gain, 0.02);
}

// Sticks in a row, or side by side on a first one, that joints of all kinds connect. Contacts and joints,
// which take turns, give them no energy, however far they turn within a step and whatever they hit; pins that
// move give them no more than their speed.
TEST_P(ThinBodies, JointedSticksGainNoEnergy) {
  constexpr double kPinSpeed = 2.0, kSeconds = 2.0;
  const int draws = GetParam() > 0.01 ? 12 : GetParam() > 0.005 ? 2 : 1;
  for_random_fixtures(15, draws, GetParam(), [&](PhysicsFixture& fixture, auto& draw) {
    scene::Material& material = fixture.scene.materials[0];
    material.friction = draw(0.1, 0.9), material.restitution = std::max(draw(-0.8, 0.8), 0.0);
    fixture.scene.surface.pin.max_speed = kPinSpeed;
    enum Bed { kLevel, kUneven, kMoving };
    const auto bed = static_cast<Bed>(draw(0, 3));
    std::vector<float> heights(fixture.cells().field().height.size());
    const auto draw_heights = [&] {
      for (float& height : heights) height = static_cast<float>(draw(0, 0.5));
      fixture.cells().set_targets(0, heights);
    };
    if (bed != kLevel) draw_heights(), fixture.run(1.0);
    const double thickness = std::exp(draw(std::log(0.01), std::log(0.2)));
    const auto count = static_cast<std::size_t>(draw(2, 7));
    const bool in_a_row = draw(0, 1) < 0.5;
    const Eigen::Quaterniond turned(tilted(draw, 1.5) *
                                    Eigen::AngleAxisd(draw(0, std::numbers::pi), Vector3d::UnitZ()));
    std::vector<scene::ObjectSpec> sticks;
    std::vector<Vector3d> moments, anchors;
    double lowest = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const double length = draw(0.5, 2);
      Eigen::Quaterniond orientation = turned;
      Vector3d anchor(0, 0, 0);
      if (i > 0 && in_a_row) {
        anchor = sticks.back().position + 0.5 * (turned * Vector3d(0, 0, sticks.back().size.z()));
      } else if (i > 0) {
        orientation = turned * Eigen::AngleAxisd(draw(0, 2 * std::numbers::pi), Vector3d::UnitZ()) *
                      Eigen::AngleAxisd(0.5 * std::numbers::pi, Vector3d::UnitY());
        anchor = turned * Vector3d(0, 0, 0.5 * static_cast<double>(i));
      }
      const Vector3d along = orientation * Vector3d(0, 0, length);
      scene::ObjectSpec o = box({thickness, thickness, length}, anchor + 0.5 * along);
      o.mass = 1;
      o.orientation = orientation;
      lowest = std::min({lowest, anchor.z() - thickness, anchor.z() + along.z() - thickness});
      const double moment = (length * length + thickness * thickness) / 12;
      moments.emplace_back(moment, moment, thickness * thickness / 6);
      sticks.push_back(o), anchors.push_back(anchor);
    }
    const Vector3d start(15, 15, 0.5 + draw(0, 5) - lowest), spin = draw(-8, 8) * anchors.back().normalized();
    for (scene::ObjectSpec& o : sticks) {
      o.velocity = spin.cross(o.position), o.angular_velocity = spin;
      o.position += start;
      fixture.add(o);
    }
    for (std::size_t i = 1; i < count; ++i)
      fixture.world().add_joint(
          {.kind = std::array{scene::JointKind::kFixed, scene::JointKind::kHinge,
                              scene::JointKind::kBall}[static_cast<std::size_t>(draw(0, 3))],
           .a = static_cast<scene::ObjectId>(i),
           .b = static_cast<scene::ObjectId>(in_a_row ? i - 1 : 0),
           .anchor = start + anchors[i],
           .axis = tilted(draw, 1.5) * Vector3d::UnitZ()});
    const auto energy = [&] {
      const scene::Snapshot& s = fixture.snapshot();
      double sum = 0;
      for (std::size_t i = 0; i < count; ++i) sum += energy_of(s, i, moments[i]);
      return sum;
    };
    const double at_start = energy();
    double greatest = at_start, fastest = 0;
    for (double time = 0; time < kSeconds; time += 0.5) {
      if (bed == kMoving) draw_heights();
      fixture.run(0.5, [&] {
        greatest = std::max(greatest, energy());
        Vector3d sum(0, 0, 0);
        for (const auto& v : fixture.snapshot().velocity) sum += Eigen::Vector3f(v.data()).cast<double>();
        fastest = std::max(fastest, sum.norm() / static_cast<double>(count));
      });
    }
    const double speed = std::sqrt(2 * at_start / static_cast<double>(count));
    EXPECT_LT(fastest, 1.05 * speed + (bed == kMoving ? 2 * kPinSpeed : 0)) << thickness << " " << count;
    if (bed != kMoving) {
      EXPECT_LT(greatest, 1.05 * at_start) << thickness << " " << count;
    }
  });
}

// Frames of welded and hinged sticks that fall on the edge of a box: no stick is thrown about, and a frame
// whose contacts and joints leave it a velocity with which it cannot move does not keep it.
TEST_P(ThinBodies, JointedSticksThatLandOnABoxComeDown) {
  const int draws = GetParam() > 0.01    ? 8
                    : GetParam() > 0.005 ? 3
                                         : 1;  // joints of fine steps take their time
  for_random_fixtures(14, draws, GetParam(), [&](PhysicsFixture& fixture, auto& draw) {
    scene::ObjectSpec edge = box({6, 1, 1}, {15, 15, 0.5});
    edge.fixed = true;
    fixture.add(edge);
    const double thickness = draw(0.05, 0.1), height = draw(3, 6);
    const Eigen::AngleAxisd turned(draw(0, std::numbers::pi), Vector3d::UnitZ());
    const Vector3d middle(15 + draw(-4, 4), 15 + draw(-1, 1), height);
    const auto add_stick = [&](const Vector3d& size, double u, double v) {
      scene::ObjectSpec o = box(size, middle + turned * Vector3d(u, v, 0));
      o.orientation = turned;
      o.mass = 1;
      return fixture.add(o);
    };
    const auto join = [&](scene::JointKind kind, scene::ObjectId a, scene::ObjectId b, double u, double v) {
      fixture.world().add_joint({.kind = kind,
                                 .a = a,
                                 .b = b,
                                 .anchor = middle + turned * Vector3d(u, v, 0),
                                 .axis = turned * Vector3d::UnitX()});
    };
    const int rungs = static_cast<int>(draw(1, 6));
    const auto left = add_stick({3.84, thickness, thickness}, 0, 0);
    const auto right = rungs > 1 ? add_stick({3.84, thickness, thickness}, 0, 1) : left;
    for (int k = 0; k < rungs; ++k) {
      const double u = -1.7 + 0.85 * k;
      const auto rung = add_stick({thickness, 0.96, thickness}, u, 0.5);
      join(scene::JointKind::kFixed, rung, left, u, 0);
      if (rungs > 1) join(k % 2 == 0 ? scene::JointKind::kBall : scene::JointKind::kHinge, rung, right, u, 1);
    }
    float fastest = 0;
    const auto watch = [&] {
      fastest = 0;
      for (const auto& v : fixture.snapshot().velocity)
        fastest = std::max(fastest, Eigen::Vector3f(v.data()).norm());
    };
    float worst = 0;
    fixture.run(2.5, [&] {
      watch();
      worst = std::max(worst, fastest);
    });
    EXPECT_LT(worst, 1.5 * std::sqrt(2 * kGravity * height)) << thickness << " " << rungs;
    EXPECT_LT(fastest, 1.5) << "still falling: " << thickness << " " << rungs;
  });
}

// Boards and sticks that pierce each other move on through each other, and are as fast as they move: held in
// the air, they would go on to gain speed.
TEST_P(ThinBodies, HeapsOfBoardsAndSticksFall) {
  constexpr int kDraws = 6, kBodies = 10;
  constexpr double kTop = 5;
  for_random_fixtures(12, kDraws, GetParam(), [&](PhysicsFixture& fixture, auto& draw) {
    const double thickness = std::exp(draw(std::log(0.01), std::log(0.1)));
    for (int i = 0; i < kBodies; ++i) {
      const Vector3d at(13 + 0.5 * i, 15 + draw(-0.2, 0.2), draw(2.5, kTop));
      scene::ObjectSpec o = box({thickness, i % 2 == 0 ? 2.0 : thickness, draw(2, 4)}, at);
      o.mass = draw(1, 3);
      o.orientation = tilted(draw, 0.1);
      fixture.add(o);
    }
    float fastest = 0;
    fixture.run(3.0, [&] {
      for (const auto& v : fixture.snapshot().velocity)
        fastest = std::max(fastest, Eigen::Vector3f(v.data()).norm());
    });
    // The tips of sticks that fall over are faster than their centres; a heavy board may throw a light stick.
    EXPECT_LT(fastest, 1.5 * std::sqrt(2 * kGravity * kTop)) << thickness;
  });
}

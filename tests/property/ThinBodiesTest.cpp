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

// Boards and sticks that pierce each other move on through each other, and are as fast as they move: held in the
// air, they would go on to gain speed.
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

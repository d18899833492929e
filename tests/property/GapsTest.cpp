// Level cells with gaps: small ones are bridged, wider ones act as they are. Both engines.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "smartsurf/mesh/SolidBuilder.h"
#include "smartsurf/world/bullet/EngineFactory.h"
#include "tests/property/PhysicsFixture.h"

using namespace physics_fixture;
using namespace smartsurf;

namespace {

constexpr double kWideGap = 0.25;  // of the pitch: greater ones are not bridged

class Gaps : public testing::TestWithParam<std::string> {
 protected:
  void SetUp() override {
    if (GetParam() == "bullet" && !world::has_bullet()) GTEST_SKIP() << "this build has no Bullet";
  }

  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }

  // Bullet is much slower.
  int draws() const { return GetParam() == "bullet" ? 4 : 24; }

  // 9 × 9 cells whose tops are `top` pitches wide, with a gravity of 9.81 pitches/s².
  void set_surface(PhysicsFixture& f, double pitch, double top) {
    f.scene.world.engine = GetParam();
    scene::SurfaceSpec& s = f.scene.surface;
    s.rows = s.columns = 9;
    s.pitch = pitch;
    s.pin.top_x = s.pin.top_y = top * pitch;
    s.pin.length = 2 * pitch;
    s.pin.max_height *= pitch;
    f.scene.world.gravity = {0, 0, -kGravity * pitch};
  }
  double random_pitch() { return draw_++ % 2 == 0 ? 1.0 : std::pow(10.0, uniform(-1, 1.3)); }
  static Eigen::Vector3d pitches(double pitch, double x, double y, double z) {
    return pitch * Eigen::Vector3d(x, y, z);
  }

  std::mt19937 random_{1};
  int draw_ = 0;
};

const Eigen::Quaterniond kAlongX(Eigen::AngleAxisd(std::numbers::pi / 2, Eigen::Vector3d::UnitY()));

}  // namespace

// A ball between four tops touches their corners, at the distance e from its axis.
TEST_P(Gaps, BallsRestBetweenFourTops) {
  for (int i = 0; i < draws(); ++i) {
    const double pitch = random_pitch(), top = uniform(0.1, 0.97 - kWideGap),
                 e = (1 - top) / std::numbers::sqrt2, radius = e * uniform(1.1, 3);
    SCOPED_TRACE(testing::Message() << "pitch " << pitch << " top " << top << " radius " << radius);
    PhysicsFixture f;
    set_surface(f, pitch, top);
    f.scene.materials[0].friction = i % 4 == 0 ? 0.0 : 0.5;
    const double z = std::sqrt(radius * radius - e * e);
    const auto id = f.add(sphere(radius * pitch, pitches(pitch, 3.5, 4.5, z + 0.05)));
    double load = 0.0;
    int steps = 0;
    const auto weigh = [&] {
      for (const float impulse : f.cells().field().impulse) load += static_cast<double>(impulse);
      ++steps;
    };
    f.run(1.5);
    f.run(0.5, weigh);
    EXPECT_LT((f.position(id).cast<double>() / pitch - Eigen::Vector3d(3.5, 4.5, z)).norm(), 1e-3);
    if (f.scene.materials[0].friction > 0.0) continue;
    // Without friction the loads, normal to the ball, have no other way to bear it.
    const double weight = f.scene.materials[0].density * 4 / 3 * std::numbers::pi *
                          std::pow(radius * pitch, 3) * kGravity * pitch * f.scene.world.dt_s;
    EXPECT_NEAR(load / steps / weight, radius / z, 5e-3 * radius / z);
  }
}

TEST_P(Gaps, BallsFallBetweenFourTops) {
  for (int i = 0; i < draws(); ++i) {
    const double pitch = random_pitch(), top = uniform(0.1, 0.9),
                 radius = (1 - top) / std::numbers::sqrt2 * uniform(0.5, 0.97);
    SCOPED_TRACE(testing::Message() << "pitch " << pitch << " top " << top << " radius " << radius);
    PhysicsFixture f;
    set_surface(f, pitch, top);
    const auto id = f.add(sphere(radius * pitch, pitches(pitch, 3.5, 4.5, radius)));
    f.run(1.5);
    EXPECT_LT(static_cast<double>(f.position(id).z()) / pitch, -2 + radius + 1e-2);
  }
}

// The ball turns about the corners in front of it once the slope is steeper than the line to them.
TEST_P(Gaps, BallsLeaveTheirPitOnASteepSlope) {
  for (int i = 0; i < draws(); ++i) {
    const double pitch = random_pitch(), top = uniform(0.1, 0.97 - kWideGap),
                 e = (1 - top) / std::numbers::sqrt2, radius = e * uniform(1.1, 2.5),
                 z = std::sqrt(radius * radius - e * e), half_gap = (1 - top) / 2,
                 angle = std::atan(half_gap / z) * (i % 2 == 0 ? 0.95 : 1.05);
    SCOPED_TRACE(testing::Message() << "pitch " << pitch << " top " << top << " radius " << radius << " rad "
                                    << angle);
    PhysicsFixture f;
    set_surface(f, pitch, top);
    f.scene.world.gravity = kGravity * pitch * Eigen::Vector3d(std::sin(angle), 0, -std::cos(angle));
    const auto id = f.add(sphere(radius * pitch, pitches(pitch, 3.5, 4.5, z)));
    f.run(2.5);
    const double moved = static_cast<double>(f.position(id).x()) / pitch - 3.5;
    if (i % 2 == 0)
      EXPECT_NEAR(moved, 0.0, 2e-3);
    else
      EXPECT_GT(moved, 0.4);
  }
}

TEST_P(Gaps, CylindersAndCapsulesLieInTheGapBetweenTwoRows) {
  for (int i = 0; i < draws(); ++i) {
    const double pitch = random_pitch(), top = uniform(0.1, 0.97 - kWideGap), half_gap = (1 - top) / 2,
                 radius = half_gap * uniform(1.1, 3), z = std::sqrt(radius * radius - half_gap * half_gap);
    SCOPED_TRACE(testing::Message() << "pitch " << pitch << " top " << top << " radius " << radius);
    PhysicsFixture f;
    set_surface(f, pitch, top);
    const Eigen::Vector3d at = pitches(pitch, 4, 4.5, z + 0.03);
    auto body = i % 4 < 2 ? cylinder(radius * pitch, 4 * pitch, at)
                          : capsule(radius * pitch, (4 + 2 * radius) * pitch, at);
    body.orientation = kAlongX;
    const auto id = f.add(body);
    f.run(2.0);
    EXPECT_NEAR(static_cast<double>(f.position(id).y()) / pitch, 4.5, 2e-3);
    EXPECT_NEAR(static_cast<double>(f.position(id).z()) / pitch, z, 2e-3);
  }
}

// Boxes and hulls of several tops' size slide over the edges of narrow tops as over a plane.
TEST_P(Gaps, FlatFacesSlideStraight) {
  if (GetParam() == "bullet") GTEST_SKIP() << "the friction of single cells is off there";
  for (int i = 0; i < draws(); ++i) {
    const double pitch = random_pitch(), top = uniform(0.3, 0.7), mu = uniform(0.15, 0.4),
                 heading = uniform(-3, 3), way = uniform(2, 5);
    PhysicsFixture f;
    set_surface(f, pitch, top);
    f.scene.surface.rows = f.scene.surface.columns = 25;
    f.scene.world.dt_s = i % 3 == 0 ? 1.0 / 60 : 1.0 / 240;
    f.scene.materials[0].friction = mu;
    const Eigen::Vector3d half(uniform(1.2, 2), uniform(1.2, 2), uniform(0.15, 0.4));
    const Eigen::Vector3d at = pitches(pitch, uniform(11, 13), uniform(11, 13), half.z());
    auto body = i % 2 == 0 ? box(2 * half * pitch, at) : scene::ObjectSpec{};
    if (i % 2 == 1) {
      std::vector<Eigen::Vector3d> corners;
      for (int k = 0; k < 8; ++k)
        corners.emplace_back(
            half.cwiseProduct(Eigen::Vector3d(k & 1 ? 1 : -1, k & 2 ? 1 : -1, k & 4 ? 1 : -1)) * pitch);
      body.shape = scene::ShapeKind::kSolid;
      body.solid = std::make_shared<scene::Solid>(mesh::build_hull_solid(corners));
      body.position = at;
    }
    body.orientation = Eigen::AngleAxisd(i % 4 == 0 ? heading : uniform(-3, 3), Eigen::Vector3d::UnitZ());
    const double speed = std::sqrt(2 * mu * kGravity * way);
    const Eigen::Vector3d along(std::cos(heading), std::sin(heading), 0);
    body.velocity = speed * pitch * along;
    SCOPED_TRACE(testing::Message() << i << " pitch " << pitch << " top " << top << " µ " << mu << " way "
                                    << way);
    const auto id = f.add(body);
    double highest = 0;
    f.run(speed / (mu * kGravity) + 0.3,
          [&] { highest = std::max(highest, static_cast<double>(f.position(id).z())); });
    const Eigen::Vector3d moved = (f.position(id).cast<double>() - at) / pitch;
    EXPECT_NEAR(moved.dot(along), way, 0.005 * way + speed * f.scene.world.dt_s);
    EXPECT_LT((moved - moved.dot(along) * along).norm(), 0.01);
    EXPECT_LT(highest / pitch - half.z(), 2e-3);
  }
}

INSTANTIATE_TEST_SUITE_P(Engines, Gaps, testing::Values("native", "bullet"),
                         [](const auto& engine) { return engine.param; });

// The native engine idealises a gap of at most a quarter of the pitch: a body too large for the hole where
// two gaps cross passes over it as over a plane.
TEST(SmallGaps, AreBridged) {
  std::mt19937 random(3);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  for (int i = 0; i < 12; ++i) {
    const double top = i == 0 ? 1 - kWideGap : uniform(1 - kWideGap, 1),
                 radius = (1 - top) / std::numbers::sqrt2 * uniform(1.05, 3);
    const double pitch = i % 2 == 0 ? 12.7 : 1.0;
    PhysicsFixture f;
    f.scene.surface.pitch = pitch;
    f.scene.surface.pin.top_x = f.scene.surface.pin.top_y = top * pitch;
    f.scene.world.gravity = {0, 0, -kGravity * pitch};
    const auto id = f.add(sphere(radius * pitch, pitch * Eigen::Vector3d(3.5, 4.5, radius + 0.01)));
    f.run(1.0);
    EXPECT_NEAR(static_cast<double>(f.position(id).z()) / pitch, radius, 1e-3)
        << "top " << top << " " << radius;
  }
}

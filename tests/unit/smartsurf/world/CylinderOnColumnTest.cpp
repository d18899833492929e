#include "smartsurf/world/CylinderOnColumn.h"

#include <gtest/gtest.h>

#include <random>

#include "tests/unit/smartsurf/world/PlacedBody.h"

using namespace smartsurf;
using namespace smartsurf::world;

namespace {

constexpr float kRounding = 0.01F, kTall = 20.0F;

PlacedBody cylinder(const Vec3& at, const Quat& turn) {
  scene::ObjectSpec o;
  o.shape = scene::ShapeKind::kCylinder;
  o.radius = 0.9;
  o.height = 1.4;
  return {o, at, turn};
}

// The same by GJK, the column as a tall box.
NearestPoints by_gjk(const Core& core, const Column& q) {
  Shape box;
  box.kind = scene::ShapeKind::kBox;
  box.half = {0.5F * (q.east - q.west), 0.5F * (q.north - q.south), 0.5F * kTall};
  box.rounding = kRounding;
  const Vec3 at(0.5F * (q.west + q.east), 0.5F * (q.south + q.north), q.top - 0.5F * kTall);
  const Mat3 upright = Mat3::Identity();
  return nearest_points(core, Core({box, nullptr}, at, upright), 100.0F, Vec3::UnitZ());
}

}  // namespace

TEST(CylinderOnColumn, IsAsFarAsGjkTells) {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> u(-1, 1);
  const Column column{-0.4F, 0.5F, -0.3F, 0.4F, 0.2F, false, false, false, false};
  int known = 0;
  for (int i = 0; i < 4000; ++i) {
    const PlacedBody body =
        cylinder({1.5F * u(random), 1.5F * u(random), 1.0F + 0.6F * u(random)}, any_turn(random));
    const Core core({body.shape, nullptr}, body.centre, body.axes);
    const auto near = nearest_on_top(core, column, kRounding);
    const NearestPoints truth = by_gjk(core, column);
    if (!near) {
      EXPECT_TRUE(!truth.apart || truth.normal.z() < 0.02F) << i;
      continue;
    }
    ++known;
    ASSERT_TRUE(truth.apart || near->distance < 1e-3F) << i;
    EXPECT_NEAR(near->distance, truth.distance, 1e-3F) << i;
    if (near->distance < 0.02F) continue;
    EXPECT_NEAR((near->on_a - near->on_b - near->distance * near->normal).norm(), 0.0F, 1e-4F) << i;
    EXPECT_GT(near->normal.dot(truth.normal), 0.99F) << i;
  }
  EXPECT_GT(known, 1500);
}

TEST(CylinderOnColumn, OneStandingOnTheTopIsAsFarAsItIsHigh) {
  const PlacedBody body = cylinder({0.1F, 0.0F, 1.0F}, Quat::Identity());
  const Core core({body.shape, nullptr}, body.centre, body.axes);
  const auto near = nearest_on_top(core, {-2, 2, -2, 2, 0, false, false, false, false}, kRounding);
  ASSERT_TRUE(near.has_value());
  EXPECT_NEAR(near->distance, 0.3F + core.rounding + kRounding, 1e-5F);
  EXPECT_FLOAT_EQ(near->normal.z(), 1.0F);
}

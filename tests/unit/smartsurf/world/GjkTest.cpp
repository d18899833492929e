#include "smartsurf/world/narrowphase/Gjk.h"

#include <gtest/gtest.h>

#include <random>

#include "tests/unit/smartsurf/world/PlacedBody.h"

using namespace smartsurf;
using namespace smartsurf::world;

namespace {

PlacedBody body(scene::ShapeKind kind, const Vec3& centre, const Quat& turn) {
  scene::ObjectSpec o;
  o.shape = kind;
  o.radius = 0.6;
  o.height = 2.0;
  o.size = {1.0, 1.4, 0.8};
  return {o, centre, turn};
}

float distance(const PlacedBody& a, const PlacedBody& b) {
  const ConvexProxy ca({a.shape, nullptr}, a.centre, a.axes), cb({b.shape, nullptr}, b.centre, b.axes);
  const ClosestPoints n = closest_points(ca, cb, 100.0F, a.centre - b.centre);
  EXPECT_TRUE(n.separated);
  return n.distance - ca.convex_radius - cb.convex_radius;
}

const scene::ShapeKind kKinds[] = {scene::ShapeKind::kBox, scene::ShapeKind::kCylinder,
                                   scene::ShapeKind::kCapsule, scene::ShapeKind::kCone};

}  // namespace

// The distance of a sphere is the signed distance of its centre less the radius.
TEST(Gjk, MatchesClosedFormSphereDistance) {
  std::mt19937 random(11);
  std::uniform_real_distribution<float> u(-1, 1);
  for (const auto kind : kKinds)
    for (int i = 0; i < 200; ++i) {
      const PlacedBody solid = body(kind, {0, 0, 0}, random_rotation(random));
      const Vec3 at = Vec3(u(random), u(random), u(random)).normalized() * (3.2F + u(random));
      const PlacedBody ball = body(scene::ShapeKind::kSphere, at, Quat::Identity());
      const SignedDistance o = signed_distance({solid.shape, nullptr}, solid.axes.transpose() * at);
      // Rounding recedes from sharp edges by a fraction of the convex radius, and by more at a cone's tip.
      const float rounds_off = kind == scene::ShapeKind::kCapsule ? 0.0F
                               : kind == scene::ShapeKind::kCone  ? 2.6F
                                                                  : 0.9F;
      const float tolerance = rounds_off * solid.shape.convex_radius + 1e-3F;
      EXPECT_NEAR(distance(ball, solid), o.distance - 0.6F, tolerance) << static_cast<int>(kind);
    }
}

TEST(Gjk, SymmetricAndDecreasesByTranslation) {
  std::mt19937 random(12);
  for (const auto first : kKinds)
    for (const auto second : kKinds) {
      const PlacedBody a = body(first, {0, 0, 0}, random_rotation(random));
      PlacedBody b = body(second, {3, 2, 1}, random_rotation(random));
      const float apart = distance(a, b);
      EXPECT_NEAR(distance(b, a), apart, 1e-3F);
      const ConvexProxy ca({a.shape, nullptr}, a.centre, a.axes), cb({b.shape, nullptr}, b.centre, b.axes);
      b.centre += 0.5F * apart * closest_points(ca, cb, 100.0F, a.centre - b.centre).normal;
      EXPECT_NEAR(distance(a, b), 0.5F * apart, 2e-3F);
    }
}

TEST(Gjk, NormalLeadsToSurface) {
  std::mt19937 random(13);
  std::uniform_real_distribution<float> u(-1, 1);
  for (const auto kind : kKinds) {
    const PlacedBody solid = body(kind, {0, 0, 0}, Quat::Identity());
    for (int i = 0; i < 300; ++i) {
      const Vec3 p(u(random), u(random), 1.5F * u(random));
      const SignedDistance o = signed_distance({solid.shape, nullptr}, p);
      EXPECT_NEAR(o.normal.norm(), 1.0F, 1e-4F);
      // Moving back along the normal by the distance must reach the surface.
      EXPECT_NEAR(signed_distance({solid.shape, nullptr}, p - o.distance * o.normal).distance, 0.0F, 2e-3F);
    }
  }
}

TEST(Gjk, SimplexCacheDoesNotChangeResult) {
  std::mt19937 random(13);
  std::uniform_real_distribution<float> u(-1, 1);
  int compared = 0;
  for (const auto first : kKinds)
    for (const auto second : kKinds) {
      PlacedBody a = body(first, {0, 0, 0}, random_rotation(random));
      PlacedBody b = body(second, {1.2F, 0.9F, 0.6F}, random_rotation(random));
      SimplexCache last;
      for (int i = 0; i < 100; ++i) {
        // Mostly small motions; every tenth is a jump.
        const bool jump = i % 10 == 9;
        b.centre += Vec3(u(random), u(random), u(random)) * (jump ? 0.3F : 0.02F);
        b.axes =
            (jump ? random_rotation(random) : Quat(1, 0.01F * u(random), 0.01F * u(random), 0)).normalized() *
            b.axes;
        const ConvexProxy ca({a.shape, nullptr}, a.centre, a.axes), cb({b.shape, nullptr}, b.centre, b.axes);
        const ClosestPoints with = closest_points(ca, cb, 100.0F, a.centre - b.centre, &last);
        const ClosestPoints without = closest_points(ca, cb, 100.0F, a.centre - b.centre);
        if (!with.separated || !without.separated) {
          EXPECT_LT(std::max(with.distance, without.distance), 1e-3F);
          continue;
        }
        ++compared;
        EXPECT_NEAR(with.distance, without.distance, 5e-4F)
            << static_cast<int>(first) << static_cast<int>(second);
        EXPECT_NEAR((with.on_a - with.on_b - with.distance * with.normal).norm(), 0.0F, 1e-4F);
      }
    }
  EXPECT_GT(compared, 800);
}

// A face on a wider one: the tetrahedra are nearly flat, and hold nothing.
TEST(Gjk, ParallelFacesAreApart) {
  std::mt19937 random(15);
  std::uniform_real_distribution<float> u(-1, 1);
  const auto block = [&](double width, double height, const Vec3& centre) {
    scene::ObjectSpec o;
    o.shape = u(random) < 0.0F ? scene::ShapeKind::kBox : scene::ShapeKind::kCylinder;
    o.size = {width, width * (1.0 + 0.5 * static_cast<double>(u(random))), height};
    o.radius = 0.5 * width, o.height = height;
    const Eigen::AngleAxisf turn(3.2F * u(random), Vec3::UnitZ()), tilt(1e-4F * u(random), Vec3::UnitX());
    return PlacedBody(o, centre, Quat(turn * tilt));
  };
  for (int i = 0; i < 60000; ++i) {
    const float middle = 60.0F + 60.0F * u(random), gap = -5e-4F + 5e-4F * u(random);
    const PlacedBody wide = block(9.0 + 5.0 * static_cast<double>(u(random)), 1, {middle, middle, 0.5F});
    const Vec3 at(middle + 0.5F * u(random), middle + 0.5F * u(random), 1.2F + gap);
    const PlacedBody rider = block(2.0 + static_cast<double>(u(random)), 0.4, at);
    EXPECT_NEAR(distance(rider, wide), gap, 2e-3F) << i;
    EXPECT_NEAR(distance(wide, rider), gap, 2e-3F) << i;
  }
}

#include "smartsurf/world/field/CylinderOnColumn.h"

#include <gtest/gtest.h>

#include <random>

#include "tests/unit/smartsurf/world/PlacedBody.h"

using namespace smartsurf;
using namespace smartsurf::world;

// Distance to the edges and corners of a column's top, compared with GJK.
TEST(CylinderOnColumn, AgreesWithGjk) {
  constexpr float kRounding = 0.01F, kDepth = 4.0F;
  const Column q{-0.4F, 0.4F, -0.5F, 0.5F, 1.0F, false, false, false, false};
  scene::ObjectSpec spec;
  spec.shape = scene::ShapeKind::kBox;
  spec.size = {0.8, 1.0, kDepth};
  PlacedBody column(spec, {0, 0, q.top - 0.5F * kDepth}, Quat::Identity());
  column.shape.convex_radius = kRounding;
  const ConvexProxy cb({column.shape, nullptr}, column.centre, column.axes);
  spec.shape = scene::ShapeKind::kCylinder;
  spec.radius = 0.9;
  spec.height = 1.4;
  std::mt19937 random(5);
  std::uniform_real_distribution<float> u(-1, 1);
  int found = 0, compared = 0;
  for (int i = 0; i < 5000; ++i) {
    const Vec3 towards = Vec3(u(random), u(random), std::abs(u(random))).normalized();
    const PlacedBody a(spec, Vec3(0, 0, q.top) + towards * (1.1F + 0.5F * u(random)),
                       random_rotation(random));
    const ConvexProxy ca({a.shape, nullptr}, a.centre, a.axes);
    const ClosestPoints truth = closest_points(ca, cb, 100.0F, towards);
    if (!truth.separated || truth.distance < 1e-3F) continue;
    ++compared;
    ClosestPoints near;
    if (!closest_on_edges(ca, q, kRounding, towards, near)) continue;
    ++found;
    EXPECT_NEAR(near.distance, truth.distance, 3e-4F) << i;
    EXPECT_GT(near.normal.dot(truth.normal), 0.995F) << i;
    EXPECT_NEAR((near.on_a - near.on_b).norm(), near.distance, 1e-4F) << i;
    // on_a must be a support point of the cylinder along −normal.
    EXPECT_NEAR(near.normal.dot(ca.support(-near.normal) - near.on_a), 0.0F, 1e-4F) << i;
  }
  EXPECT_GT(compared, 1000);
  EXPECT_GT(found, compared / 2);
}

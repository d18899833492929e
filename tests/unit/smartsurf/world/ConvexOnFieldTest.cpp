// Cylinders on columns where GJK does not suffice: penetration deeper than GJK resolves, and contact along an
// edge, for which GJK returns one point.
#include "smartsurf/world/field/ConvexOnField.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "tests/unit/smartsurf/world/PlacedBody.h"

using namespace smartsurf;
using namespace smartsurf::world;
using scene::ShapeKind;

namespace {

constexpr int kConvexSide = 9;

// Low cells, and one in the middle with its top at 0.
surface::Field make_single_column_field() {
  surface::Field field;
  field.rows = field.columns = kConvexSide;
  field.height.assign(kConvexSide * kConvexSide, -3.0F);
  field.speed.assign(kConvexSide * kConvexSide, 0.0F);
  field.height[static_cast<std::size_t>(field.index(4, 4))] = 0.0F;
  field.max_height = 0.0F;
  return field;
}

// Depth of a point, in cylinder axes, inside a cylinder of radius 1.2 and height 2.
float depth_in_cylinder(const Vec3& p) {
  return std::min(1.2F - std::hypot(p.x(), p.y()), 1.0F - std::abs(p.z()));
}

}  // namespace

TEST(ConvexOnField, DeepColumnPushesCylinderOut) {
  scene::ObjectSpec o;
  o.shape = ShapeKind::kCylinder;
  o.radius = 1.2;
  o.height = 2.0;
  const Shape shape = make_shape(o);
  const surface::Field field = make_single_column_field();
  std::mt19937 random(8);
  std::uniform_real_distribution<float> u(-1, 1);
  int deep = 0;
  for (int i = 0; i < 3000; ++i) {
    const Mat3 axes = random_rotation(random).normalized().toRotationMatrix();
    const Vec3 inside = Vec3(1.2F * u(random), 1.2F * u(random), u(random));  // centre of the column's top
    const float depth = depth_in_cylinder(inside);
    // Only columns that entered from below and not past the middle.
    if (depth < 0.03F || depth > 0.4F || (axes * inside).z() > -0.5F) continue;
    ++deep;
    std::vector<Contact> found;
    collide_shape_with_field(field, shape, Vec3(4, 4, 0) - axes * inside, axes, 0.03F, found);
    ASSERT_FALSE(found.empty()) << i << ", " << depth << " deep";
    float least = 1.0F;
    for (const Contact& c : found) {
      least = std::min(least, c.separation);
      EXPECT_GT(c.normal.z(), -0.01F) << i;
    }
    EXPECT_LT(least, -0.5F * depth) << i << ", " << depth << " deep";
  }
  EXPECT_GT(deep, 200);
}

TEST(ConvexOnField, CylinderAlongEdgeTouchesAtBothEnds) {
  scene::ObjectSpec o;
  o.shape = ShapeKind::kCylinder;
  o.radius = 1.2;
  o.height = 2.0;
  const Shape shape = make_shape(o);
  surface::Field field = make_single_column_field();
  for (int row = 0; row < kConvexSide; ++row)
    field.height[static_cast<std::size_t>(field.index(row, 4))] = 0.0F;
  // Beside the ridge's eastern edge, almost parallel to it.
  const float beside = 0.5F, above = std::sqrt(1.2F * 1.2F - beside * beside) - 0.003F;
  const Vec3 centre(4.0F + field.half_top_x + beside, 4.1F, above);
  const Mat3 axes = Quat(Eigen::AngleAxisf(1.5717963F, Vec3::UnitX())).toRotationMatrix();
  std::vector<Contact> found;
  collide_shape_with_field(field, shape, centre, axes, 0.03F, found);
  float south = 1.0F, north = -1.0F;
  for (const Contact& c : found) south = std::min(south, c.anchor.y()), north = std::max(north, c.anchor.y());
  EXPECT_LT(south, -0.9F);
  EXPECT_GT(north, 0.9F);
}

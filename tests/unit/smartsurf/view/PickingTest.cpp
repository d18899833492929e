#include "smartsurf/view/interaction/Picking.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "tests/unit/smartsurf/view/TestScene.h"

namespace smartsurf::view {
namespace {

Ray downward_ray(double x, double y) { return {{x, y, 100.0}, {0.0, 0.0, -1.0}}; }

TEST(Picking, PixelRayInvertsProjection) {
  const Camera camera = Camera::fit_to_surface(scene::SurfaceSpec{}, CameraPreset::kIso, 16.0 / 9.0);
  for (const Eigen::Vector3d& point : {Eigen::Vector3d(3.0, 5.0, 1.0), Eigen::Vector3d(60.0, 2.0, 4.0)}) {
    const Eigen::Vector3d pixel = camera.project(point, 1280, 720);
    const Ray ray = camera.ray(pixel.x(), pixel.y(), 1280, 720);
    EXPECT_NEAR(ray.direction.norm(), 1.0, 1e-12);
    EXPECT_LT((point - ray.origin).cross(ray.direction).norm(), 1e-6);
    EXPECT_GT((point - ray.origin).dot(ray.direction), 0.0);
  }
}

TEST(Picking, FindsNearestObjectAboveCells) {
  TestScene scene(16, 16);
  scene.add_sphere(7.0, 5.0, 6.0, 2.0, {});
  scene.add_sphere(7.0, 5.0, 20.0, 1.0, {});
  const auto hit = pick(downward_ray(7.3, 5.1), scene.spec.surface, {scene.snapshot, scene.spec.objects});
  ASSERT_TRUE(hit);
  EXPECT_EQ(hit->item.kind, SceneItem::Kind::kObject);
  EXPECT_EQ(hit->item.object, 1u) << "not the upper one";
  EXPECT_NEAR((hit->point - Eigen::Vector3d(7.0, 5.0, 20.0)).norm(), 1.0, 1e-9);
}

TEST(Picking, FindsCellWithRowZeroNorth) {
  TestScene scene(8, 16);
  const auto hit = pick(downward_ray(12.2, 6.9), scene.spec.surface, {scene.snapshot, scene.spec.objects});
  ASSERT_TRUE(hit);
  EXPECT_EQ(hit->item.kind, SceneItem::Kind::kCell);
  EXPECT_EQ(hit->item.row, 0);
  EXPECT_EQ(hit->item.column, 12);
  EXPECT_NEAR(hit->point.z(), 4.0, 1e-6);
  EXPECT_FALSE(pick(downward_ray(17.0, 3.0), scene.spec.surface, {scene.snapshot, scene.spec.objects}));
}

TEST(Picking, RaisedPinHidesCellsBehindIt) {
  TestScene scene(8, 8, 0.0f);
  scene.snapshot.height[scene.spec.surface.index(4, 3)] = 5.0f;  // at x = 3, y = 3
  const Ray slanted{{-10.0, 3.0, 12.0}, Eigen::Vector3d(1.0, 0.0, -0.7).normalized()};
  const auto hit = pick(slanted, scene.spec.surface, {scene.snapshot, scene.spec.objects});
  ASSERT_TRUE(hit);
  EXPECT_EQ(hit->item.row, 4);
  EXPECT_EQ(hit->item.column, 3) << "the ray passed through the pin";
  EXPECT_NEAR(hit->point.x(), 2.5, 1e-3) << "its west side";
}

// Over cells of pitch 2 inside a border, nodes every 1 u; heights rise to the east and have one dent.
TEST(Picking, SkinHidesTheCellsUnderIt) {
  TestScene scene(8, 8, 3.0f);
  scene::SurfaceSpec& s = scene.spec.surface;
  s.pitch = 2.0;
  s.border_height = 3.0;
  s.skin = scene::SkinSpec{.rows = 13, .columns = 13, .margin = 1.0};
  const auto picked = [&](const Ray& ray) { return pick(ray, s, {scene.snapshot, scene.spec.objects}); };
  const Ray slanted{{-10.0, 3.0, 12.0}, Eigen::Vector3d(1.0, 0.1, -0.7).normalized()};
  const auto bare = picked(slanted);
  for (int row = 0; row < 13; ++row)
    for (int column = 0; column < 13; ++column)
      scene.snapshot.skin_height.push_back(3.0f + 0.25f * static_cast<float>(column));
  for (const double x : {1.01, 4.3, 7.9, 12.9}) {
    const auto hit = picked(downward_ray(x, 6.6));
    ASSERT_TRUE(hit);
    EXPECT_NEAR(hit->point.z(), 3.0 + 0.25 * (x - 1.0), 1e-6);
    EXPECT_EQ(hit->item.column, std::clamp(static_cast<int>(std::lround(x / 2.0)), 1, 6));
    EXPECT_EQ(hit->item.row, 4);
  }
  EXPECT_NEAR(picked(downward_ray(0.5, 6.6))->point.z(), 3.0, 1e-6) << "the border";
  const auto sloping = picked(slanted);
  ASSERT_TRUE(sloping && bare);
  EXPECT_LT(sloping->distance, bare->distance);
  EXPECT_NEAR(sloping->point.z(), 3.0 + 0.25 * (sloping->point.x() - 1.0), 1e-6);
  // The node at x = 4, y = 10: the diagonals of its rectangles run from the north-west to the south-east.
  scene.snapshot.skin_height[3 * 13 + 3] -= 1.0f;
  EXPECT_NEAR(picked(downward_ray(4.0, 10.0))->point.z(), 2.75, 1e-6);
  EXPECT_NEAR(picked(downward_ray(4.5, 9.5))->point.z(), 3.375, 1e-6) << "on the diagonal";
  EXPECT_NEAR(picked(downward_ray(4.5, 10.5))->point.z(), 3.875, 1e-6) << "on the other one's line";
  const Ray level{{-5.0, 6.0, 4.0}, Eigen::Vector3d::UnitX()};
  EXPECT_NEAR(picked(level)->point.x(), 5.0, 1e-6);
}

TEST(Picking, RayEntersShapesAtTheirSurface) {
  scene::ObjectSpec object;
  object.radius = 1.0;
  object.height = 3.0;
  object.size = {2.0, 3.0, 4.0};
  const auto along = [&](const Eigen::Vector3d& from) {
    return intersect(object, {from, -from.normalized()}).value_or(-1.0);
  };
  const auto expect = [&](double x, double z_up, double z_down) {
    EXPECT_NEAR(along({10, 0, 0}), 10.0 - x, 1e-9);
    EXPECT_NEAR(along({0, 0, 10}), 10.0 - z_up, 1e-9);
    EXPECT_NEAR(along({0, 0, -10}), 10.0 - z_down, 1e-9);
    EXPECT_FALSE(intersect(object, {{10, 5, 0}, {-1, 0, 0}}));
    EXPECT_FALSE(intersect(object, {{10, 0, 0}, {1, 0, 0}})) << "behind the eye";
  };
  object.shape = scene::ShapeKind::kSphere;
  expect(1.0, 1.0, 1.0);
  object.shape = scene::ShapeKind::kBox;
  expect(1.0, 2.0, 2.0);
  object.shape = scene::ShapeKind::kCylinder;
  expect(1.0, 1.5, 1.5);
  object.shape = scene::ShapeKind::kCapsule;
  expect(1.0, 1.5, 1.5);
  object.shape = scene::ShapeKind::kCone;  // the centre of mass is a quarter of the height above the base
  expect(0.75, 2.25, 0.75);
}

TEST(Picking, RayEntersSolidThroughItsTriangles) {
  auto solid = std::make_shared<scene::Solid>();
  solid->vertices = {{0, 0, 0}, {2, 0, 0}, {0, 2, 0}, {0, 0, 2}};
  solid->triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  scene::ObjectSpec object;
  object.shape = scene::ShapeKind::kSolid;
  object.solid = solid;
  EXPECT_NEAR(intersect(object, {{0.5, 0.5, 9.0}, {0, 0, -1}}).value(), 8.0, 1e-6);
  EXPECT_FALSE(intersect(object, {{1.5, 1.5, 9.0}, {0, 0, -1}}));
}

}  // namespace
}  // namespace smartsurf::view

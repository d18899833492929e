#include "smartsurf/mesh/ConvexHull.h"

#include <gtest/gtest.h>

#include <random>

#include "smartsurf/mesh/MassProperties.h"
#include "tests/unit/smartsurf/mesh/TestMeshes.h"

namespace smartsurf::mesh {
namespace {

std::vector<Eigen::Vector3f> random_points(unsigned seed, std::size_t count) {
  std::mt19937 random(seed);
  const auto number = [&] { return static_cast<float>(random()) / 4294967296.0F * 2.0F - 1.0F; };
  std::vector<Eigen::Vector3f> points;
  for (std::size_t i = 0; i < count; ++i) points.emplace_back(number(), number(), 0.3F * number());
  return points;
}

double volume_of(const scene::ConvexHull& piece) {
  MassProperties properties;
  properties.add(piece);
  return properties.volume();
}

void expect_holds(const scene::ConvexHull& piece, const std::vector<Eigen::Vector3f>& points,
                  float tolerance) {
  for (const auto& face : piece.faces)
    for (const auto& p : points) ASSERT_LE(face.normal.dot(p), face.offset + tolerance);
}

TEST(Hull, CubeWithExtraPointsHasSixFaces) {
  std::vector<Eigen::Vector3f> points{{0, 0, 0}, {0.5F, 0.5F, 0}, {1, 0.5F, 0.25F}};
  for (int i = 0; i < 8; ++i) points.emplace_back(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1);
  const auto cube = convex_hull(points);
  ASSERT_TRUE(cube);
  EXPECT_EQ(cube->vertices.size(), 8U);
  ASSERT_EQ(cube->faces.size(), 6U);
  for (const auto& face : cube->faces) {
    EXPECT_EQ(face.vertex_count, 4U);
    EXPECT_FLOAT_EQ(face.offset, 1.0F);
  }
  EXPECT_EQ(cube->edges.size(), 12U);
  EXPECT_EQ(cube->unique_normals.size(), 3U);
  EXPECT_EQ(cube->unique_edge_directions.size(), 3U);
  EXPECT_EQ(cube->bounds_min, Eigen::Vector3f(-1, -1, -1));
  EXPECT_EQ(cube->bounds_max, Eigen::Vector3f(1, 1, 1));
  EXPECT_DOUBLE_EQ(volume_of(*cube), 8.0);
}

TEST(Hull, ContainsAllPointsAndFacesOutward) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    const auto points = random_points(seed, 60);
    const auto hull = convex_hull(points);
    ASSERT_TRUE(hull);
    expect_holds(*hull, points, 4e-6F);
    EXPECT_EQ(hull->vertices.size() + hull->faces.size(), hull->edges.size() + 2) << "Euler";
    for (const auto& corner : hull->vertices)
      EXPECT_NE(std::find(points.begin(), points.end(), corner), points.end());
  }
}

TEST(Hull, IsDeterministic) {
  const auto points = random_points(7, 200);
  const auto a = convex_hull(points), b = convex_hull(points);
  EXPECT_EQ(a->vertices, b->vertices);
  EXPECT_EQ(a->face_vertices, b->face_vertices);
}

TEST(Hull, NoHullForFlatOrTooFewPoints) {
  const std::vector<Eigen::Vector3f> square{{0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}, {0.5F, 0.5F, 1}};
  EXPECT_FALSE(convex_hull(square));
  EXPECT_FALSE(convex_hull(std::vector<Eigen::Vector3f>(10, {1, 2, 3})));
  EXPECT_FALSE(convex_hull(std::span(square).first(3)));
  const std::vector<Eigen::Vector3d> line{{0, 0, 0}, {1, 1, 1}, {2, 2, 2}, {3, 3, 3}};
  EXPECT_EQ(hull_volume(line), 0.0);
}

TEST(Hull, LimitsVertexCount) {
  std::vector<Eigen::Vector3f> points;
  for (const auto& p : icosphere(3).points) points.push_back(p.cast<float>());
  ASSERT_GT(points.size(), kMaxHullCorners);
  const auto hull = convex_hull(points);
  ASSERT_TRUE(hull);
  EXPECT_LE(hull->vertices.size(), kMaxHullCorners);
  EXPECT_GT(hull->vertices.size(), kMaxHullCorners / 2);
  EXPECT_NEAR(volume_of(*hull) / (4.0 / 3.0 * std::numbers::pi), 1.0, 0.05);
}

}  // namespace
}  // namespace smartsurf::mesh

#include "smartsurf/scene/Solid.h"

#include <gtest/gtest.h>

namespace smartsurf::scene {
namespace {

// A square pyramid with its apex above one corner: five vertices, five faces.
ConvexHull pyramid() {
  return make_convex_hull({{0, 0, 0}, {2, 0, 0}, {2, 2, 0}, {0, 2, 0}, {0, 0, 2}},
                          {0, 3, 2, 1, 0, 1, 4, 1, 2, 4, 2, 3, 4, 3, 0, 4},
                          std::vector<std::uint32_t>{4, 3, 3, 3, 3});
}

TEST(ConvexPiece, KeepsGivenFaces) {
  const ConvexHull p = pyramid();
  ASSERT_EQ(p.faces.size(), 5U);
  EXPECT_EQ(p.faces[0].normal, Eigen::Vector3f(0, 0, -1));
  EXPECT_EQ(p.faces[0].offset, 0.0F);
  EXPECT_EQ(p.faces[0].vertex_count, 4U);
  EXPECT_EQ(p.faces[2].first_vertex, 7U);
  EXPECT_LT((p.faces[2].normal - Eigen::Vector3f(1, 0, 1).normalized()).norm(), 1e-6F);
  EXPECT_NEAR(p.faces[2].offset, std::sqrt(2.0F), 1e-6F);
}

TEST(ConvexPiece, UniqueEdgesAndDirections) {
  const ConvexHull p = pyramid();
  EXPECT_EQ(p.edges.size(), 8U);
  for (const auto& [a, b] : p.edges) EXPECT_LT(a, b);
  EXPECT_EQ(p.unique_edge_directions.size(), 6U) << "the square's edges have two directions";
  EXPECT_EQ(p.unique_normals.size(), 5U);
  EXPECT_EQ(p.bounds_min, Eigen::Vector3f(0, 0, 0));
  EXPECT_EQ(p.bounds_max, Eigen::Vector3f(2, 2, 2));
}

TEST(Solid, BoundsFollowVertices) {
  Solid solid;
  solid.vertices = {{1, -2, 0}, {-3, 0, 4}, {0, 1, -1}};
  compute_bounds(solid);
  EXPECT_EQ(solid.bounds_min, Eigen::Vector3f(-3, -2, -1));
  EXPECT_EQ(solid.bounds_max, Eigen::Vector3f(1, 1, 4));
  EXPECT_EQ(solid.bounding_radius, 5.0F);
}

}  // namespace
}  // namespace smartsurf::scene

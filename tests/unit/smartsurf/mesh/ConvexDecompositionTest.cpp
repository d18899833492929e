#include "smartsurf/mesh/ConvexDecomposition.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <numeric>

#include "smartsurf/mesh/ClippedMesh.h"
#include "smartsurf/mesh/ConvexHull.h"
#include "tests/unit/smartsurf/mesh/TestMeshes.h"

namespace smartsurf::mesh {
namespace {

double total_hull_volume(const std::vector<std::vector<Eigen::Vector3d>>& parts) {
  return std::accumulate(parts.begin(), parts.end(), 0.0,
                         [](double sum, const auto& part) { return sum + hull_volume(part); });
}

// Rotated and translated, so that no face is axis-aligned.
TriangleMesh rotated_and_moved(TriangleMesh mesh) {
  const Eigen::AngleAxisd turn(1.1, Eigen::Vector3d(0.3, -0.7, 0.5).normalized());
  for (auto& p : mesh.points) p = turn * p + Eigen::Vector3d(3, -2, 1);
  return mesh;
}

// A U: two arms on a base.
TriangleMesh u_mesh() {
  return prism({{0, 0}, {3, 0}, {3, 3}, {2, 3}, {2, 1}, {1, 1}, {1, 3}, {0, 3}},
               {{0, 1, 4}, {0, 4, 5}, {1, 2, 3}, {1, 3, 4}, {0, 5, 6}, {0, 6, 7}}, 1.0);
}

TEST(ConvexParts, ConvexBodyIsOnePart) {
  EXPECT_EQ(decompose_convex(rotated_and_moved(box_mesh({0, 0, 0}, {1, 2, 3})), {}).size(), 1U);
  EXPECT_EQ(decompose_convex(icosphere(2), {}).size(), 1U);
}

TEST(ConvexParts, LShapeIsTwoBoxes) {
  for (const TriangleMesh& mesh : {l_mesh(), rotated_and_moved(l_mesh())}) {
    const auto parts = decompose_convex(mesh, {});
    ASSERT_EQ(parts.size(), 2U);
    EXPECT_NEAR(total_hull_volume(parts), 5.0, 1e-9);
  }
}

TEST(ConvexParts, UShapeIsThreeBoxes) {
  const auto parts = decompose_convex(rotated_and_moved(u_mesh()), {});
  EXPECT_EQ(parts.size(), 3U);
  EXPECT_NEAR(total_hull_volume(parts), 7.0, 1e-9);
}

TEST(ConvexParts, HollowBoxIsSplitIntoWalls) {
  TriangleMesh mesh = box_mesh({0, 0, 0}, {4, 4, 4}), hole = box_mesh({1, 1, 1}, {3, 3, 3});
  invert_orientation(hole);
  add(mesh, hole);
  const auto parts = decompose_convex(mesh, {});
  EXPECT_EQ(parts.size(), 6U);
  EXPECT_NEAR(total_hull_volume(parts), 56.0, 1e-9);
}

TEST(ConvexParts, TorusStaysWithinExcessLimit) {
  const TriangleMesh ring = torus(3.0, 1.0, 32, 16);
  const double volume = volume_of(ring);
  const auto parts = decompose_convex(ring, {.max_parts = 32, .max_excess = 0.03});
  EXPECT_LE(parts.size(), 24U);
  EXPECT_LT(total_hull_volume(parts), 1.03 * volume);
  EXPECT_GT(total_hull_volume(parts), volume);
  EXPECT_LE(decompose_convex(ring, {.max_parts = 5, .max_excess = 0.0}).size(), 5U);
}

TEST(ConvexParts, PartsCoverTheSolid) {
  const TriangleMesh ring = torus(3.0, 1.0, 24, 12);
  std::vector<scene::ConvexHull> pieces;
  for (const auto& part : decompose_convex(ring, {})) {
    std::vector<Eigen::Vector3f> points;
    for (const auto& p : part) points.push_back(p.cast<float>());
    pieces.push_back(*convex_hull(points));
  }
  const auto held = [&](const Eigen::Vector3f& p) {
    for (const auto& piece : pieces)
      if (std::all_of(piece.faces.begin(), piece.faces.end(),
                      [&](const auto& face) { return face.normal.dot(p) <= face.offset + 1e-4F; }))
        return true;
    return false;
  };
  int tried = 0;
  for (double x = -4; x <= 4; x += 0.27)
    for (double y = -4; y <= 4; y += 0.29)
      for (const double z : {-0.6, 0.0, 0.8})
        if (winding_number(ring, {x, y, z}) > 0.5) {
          EXPECT_TRUE(held(Eigen::Vector3d(x, y, z).cast<float>())) << x << ' ' << y << ' ' << z;
          ++tried;
        }
  EXPECT_GT(tried, 500);
}

TEST(Part, CutsPreserveVolume) {
  for (const TriangleMesh& mesh : {u_mesh(), rotated_and_moved(u_mesh()), torus(3.0, 1.0, 16, 8), l_mesh()}) {
    ClippedMesh part(mesh);
    double cut_off = 0.0;
    // Cuts successively by planes through faces, along edges and through the interior.
    for (const Plane& plane : {Plane{{1, 0, 0}, 1.0}, Plane{{0, 0.6, 0.8}, 0.7}, Plane{{0, 1, 0}, 1.0},
                               Plane{{0.6, -0.8, 0}, 0.1}}) {
      cut_off += part.clip_below(plane.flipped()).volume();
      part = part.clip_below(plane);
      EXPECT_NEAR(part.volume() + cut_off, volume_of(mesh), 1e-9);
    }
  }
}

TEST(Part, HullPointsIncludeInteriorCorners) {
  const TriangleMesh cube = box_mesh({0, 0, 0}, {2, 2, 2});
  ClippedMesh part(cube);
  for (int axis = 0; axis < 3; ++axis) {
    part = part.clip_below({Eigen::Vector3d::Unit(axis), 1.5});
    part = part.clip_below({-Eigen::Vector3d::Unit(axis), -0.5});
  }
  // The cell is entirely inside; no surface triangles remain.
  EXPECT_NEAR(part.volume(), 1.0, 1e-12);
  EXPECT_EQ(part.hull_points().size(), 8U);
  EXPECT_NEAR(hull_volume(part.hull_points()), 1.0, 1e-12);
}

}  // namespace
}  // namespace smartsurf::mesh

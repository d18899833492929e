// Tests the checks and repairs of meshes: closed, oriented, welded.
#include <gtest/gtest.h>

#include "tests/unit/smartsurf/mesh/TestMeshes.h"

namespace smartsurf::mesh {
namespace {

using testing::Test;

TriangleMesh cube(double low = 0.0, double high = 1.0) {
  return box_mesh(Eigen::Vector3d::Constant(low), Eigen::Vector3d::Constant(high));
}

TEST(Shells, KeepsValidMesh) {
  TriangleMesh mesh = l_mesh();
  const auto before = mesh.triangles;
  EXPECT_TRUE(orient_shells(mesh).empty());
  EXPECT_EQ(mesh.triangles, before);
}

TEST(Shells, FlipsInsideOutMesh) {
  TriangleMesh mesh = cube();
  invert_orientation(mesh);
  const auto said = orient_shells(mesh);
  ASSERT_EQ(said.size(), 1U);
  EXPECT_EQ(said[0], "the mesh was inside out: flipped");
  EXPECT_DOUBLE_EQ(volume_of(mesh), 1.0);
}

TEST(Shells, CountsFlippedTriangles) {
  TriangleMesh mesh = cube();
  std::swap(mesh.triangles[5][0], mesh.triangles[5][1]);
  TriangleMesh two = mesh;
  std::swap(two.triangles[8][0], two.triangles[8][1]);
  EXPECT_EQ(orient_shells(mesh).front(), "1 triangle faced against its neighbours: flipped");
  EXPECT_EQ(orient_shells(two).front(), "2 triangles faced against their neighbours: flipped");
}

TEST(Shells, FlipsSingleTriangle) {
  for (std::size_t wrong = 0; wrong < 12; ++wrong) {
    TriangleMesh mesh = cube();
    std::swap(mesh.triangles[wrong][0], mesh.triangles[wrong][1]);
    EXPECT_EQ(orient_shells(mesh).size(), 1U);
    EXPECT_DOUBLE_EQ(volume_of(mesh), 1.0) << wrong;
  }
}

TEST(Shells, RejectsOpenMeshWithFirstOpenEdge) {
  TriangleMesh mesh = cube();
  mesh.triangles.erase(mesh.triangles.begin() + 2, mesh.triangles.begin() + 4);  // the top
  EXPECT_EQ(
      error_message_of([&] { orient_shells(mesh); }),
      "the mesh is open: 4 edges have only one triangle, the first from (0, 0, 1) to (1, 0, 1); close its "
      "holes in a mesh editor, or use its convex hull, hull{file = ...}");
}

TEST(Shells, RejectsThreeTrianglesAtOneEdge) {
  TriangleMesh mesh = cube();
  // A two-sided diagonal wall: every edge is balanced, but not within each shell.
  add_quad(mesh, {0, 1, 7, 6});
  add_quad(mesh, {6, 7, 1, 0});
  weld_points(mesh, 0.0);
  mesh.triangles.pop_back();
  EXPECT_NE(error_message_of([&] { orient_shells(mesh); }), "");
}

TEST(Shells, RejectsOneSidedMesh) {
  // The 6-vertex triangulation of the projective plane: closed, but not orientable.
  TriangleMesh mesh{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 0}, {1, 0, 1}},
                    {{0, 1, 4},
                     {0, 4, 3},
                     {0, 3, 5},
                     {0, 5, 2},
                     {0, 2, 1},
                     {1, 2, 3},
                     {1, 3, 5},
                     {1, 5, 4},
                     {2, 3, 4},
                     {2, 4, 5}}};
  EXPECT_NE(error_message_of([&] { orient_shells(mesh); }).find("only one side"), std::string::npos);
}

TEST(Shells, CavityFacesInwards) {
  TriangleMesh mesh = cube(0.0, 4.0);
  TriangleMesh hole = cube(1.0, 2.0);
  invert_orientation(hole);
  add(mesh, hole);
  EXPECT_TRUE(orient_shells(mesh).empty());
  EXPECT_DOUBLE_EQ(volume_of(mesh), 63.0);
}

TEST(Shells, NestedShellBecomesCavity) {
  TriangleMesh mesh = cube(0.0, 4.0);
  add(mesh, cube(1.0, 2.0));
  EXPECT_EQ(orient_shells(mesh), std::vector<std::string>{"1 shell of 2 faced the wrong way: flipped"});
  EXPECT_DOUBLE_EQ(volume_of(mesh), 63.0);
}

TEST(Shells, CrossingShellsAreNoCavities) {
  // The first point of the second cube lies in the first one.
  TriangleMesh mesh = cube(0.0, 4.0);
  add(mesh, cube(1.0, 6.0));
  EXPECT_TRUE(orient_shells(mesh).empty());
  EXPECT_DOUBLE_EQ(volume_of(mesh), 64.0 + 125.0);
}

TEST(Shells, CubesTouchingAlongEdgeAreTwoShells) {
  TriangleMesh mesh = cube(0.0, 1.0);
  add(mesh, box_mesh({1, 1, 0}, {2, 2, 1}));
  weld_points(mesh, 1e-9);
  EXPECT_EQ(mesh.points.size(), 14U);
  EXPECT_TRUE(orient_shells(mesh).empty());
  EXPECT_DOUBLE_EQ(volume_of(mesh), 2.0);
}

TEST(JoinPoints, MergesNearPointsAndRemovesDuplicates) {
  TriangleMesh mesh;
  for (const auto& t : cube().triangles)  // separate points per triangle, slightly displaced
    for (const std::uint32_t i : t)
      mesh.points.push_back(cube().points[i] +
                            Eigen::Vector3d::Constant(1e-9 * static_cast<double>(mesh.points.size())));
  for (std::uint32_t i = 0; i < 36; i += 3) mesh.triangles.push_back({i, i + 1, i + 2});
  mesh.triangles.push_back({0, 1, 2});  // duplicate
  mesh.points.emplace_back(9, 9, 9);    // unused
  weld_points(mesh, 1e-6);
  EXPECT_EQ(mesh.points.size(), 8U);
  EXPECT_EQ(mesh.triangles.size(), 12U);
  EXPECT_TRUE(orient_shells(mesh).empty());
}

TEST(WindingNumber, IsOneInsideAndZeroOutside) {
  const TriangleMesh ring = torus(3.0, 1.0, 24, 12);
  EXPECT_NEAR(winding_number(ring, {3, 0, 0}), 1.0, 1e-12);
  EXPECT_NEAR(winding_number(ring, {0, 0, 0}), 0.0, 1e-12);
  EXPECT_NEAR(winding_number(ring, {3, 0, 2}), 0.0, 1e-12);
}

}  // namespace
}  // namespace smartsurf::mesh

#include "smartsurf/mesh/MeshSimplification.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <random>
#include <set>

#include "smartsurf/mesh/ConvexDecomposition.h"
#include "smartsurf/mesh/ConvexHull.h"
#include "tests/unit/smartsurf/mesh/TestMeshes.h"

namespace smartsurf::mesh {
namespace {

// Points − edges + triangles: 2 for a ball, 0 for a torus.
std::ptrdiff_t euler_characteristic(const TriangleMesh& mesh) {
  std::set<std::pair<std::uint32_t, std::uint32_t>> edges;
  for (const auto& t : mesh.triangles)
    for (std::size_t i = 0; i < 3; ++i) edges.insert(std::minmax(t[i], t[(i + 1) % 3]));
  return std::ssize(mesh.points) - std::ssize(edges) + std::ssize(mesh.triangles);
}

void expect_closed_and_oriented(TriangleMesh mesh) { EXPECT_TRUE(orient_shells(mesh).empty()); }

TEST(MeshSimplification, SmallMeshIsLeftAsItIs) {
  const TriangleMesh ring = torus(3.0, 1.0, 20, 10), same = simplified(ring, ring.triangles.size());
  EXPECT_EQ(same.points, ring.points);
  EXPECT_EQ(same.triangles, ring.triangles);
}

TEST(MeshSimplification, StaysCloseToRandomTori) {
  for (unsigned seed = 1; seed <= 6; ++seed) {
    SCOPED_TRACE(seed);
    std::mt19937 random(seed);
    const auto draw = [&](double low, double high) {
      return std::uniform_real_distribution(low, high)(random);
    };
    const double minor = draw(0.3, 2.0), scale = std::pow(10.0, draw(-2.0, 4.0));
    TriangleMesh ring = torus(3.0, minor, 160, 60);
    const Eigen::Quaterniond turn =
        Eigen::Quaterniond(draw(-1, 1), draw(-1, 1), draw(-1, 1), draw(-1, 1)).normalized();
    for (auto& p : ring.points) p = turn * p * scale;
    const TriangleMesh few = simplified(ring, 2000);
    EXPECT_EQ(few.triangles.size(), 2000U);
    expect_closed_and_oriented(few);
    EXPECT_EQ(euler_characteristic(few), 0);
    EXPECT_NEAR(volume_of(few) / volume_of(ring), 1.0, 0.01);
    const auto distance = [&](const Eigen::Vector3d& at) {  // from the surface
      const Eigen::Vector3d p = turn.conjugate() * at / scale;
      return std::abs(std::hypot(p.head<2>().norm() - 3.0, p.z()) - minor);
    };
    for (const auto& p : few.points) EXPECT_LT(distance(p), 0.02 * minor);
    for (const auto& t : few.triangles)
      EXPECT_LT(distance((few.points[t[0]] + few.points[t[1]] + few.points[t[2]]) / 3.0), 0.05 * minor);
  }
}

TEST(MeshSimplification, EdgesStaySharp) {
  // An L whose triangles are split into four, five times.
  TriangleMesh mesh = l_mesh();
  for (int round = 0; round < 5; ++round) {
    split_triangles(mesh, [&](std::uint32_t a, std::uint32_t b) {
      mesh.points.push_back(0.5 * (mesh.points[a] + mesh.points[b]));
      return static_cast<std::uint32_t>(mesh.points.size() - 1);
    });
    weld_points(mesh, 1e-9);
  }
  const TriangleMesh few = simplified(mesh, 100);
  EXPECT_LE(few.triangles.size(), 100U);
  EXPECT_NEAR(volume_of(few), 5.0, 1e-3);
  EXPECT_NEAR(hull_volume(few.points), hull_volume(mesh.points), 1e-3);
}

TEST(MeshSimplification, WallsAndShellsStayApart) {
  // A thin hollow ball, with another one beside it.
  TriangleMesh mesh = icosphere(5), cavity = icosphere(5), other = icosphere(3);
  for (auto& p : cavity.points) p *= 0.95;
  invert_orientation(cavity);
  for (auto& p : other.points) p = 0.1 * p + Eigen::Vector3d(2, 0, 0);
  add(mesh, cavity);
  add(mesh, other);
  const TriangleMesh few = simplified(mesh, 4000);
  EXPECT_EQ(few.triangles.size(), 4000U);
  expect_closed_and_oriented(few);
  EXPECT_EQ(euler_characteristic(few), 6);
  EXPECT_NEAR(volume_of(few) / volume_of(mesh), 1.0, 0.02);
  EXPECT_GE(simplified(mesh, 1).triangles.size(), 12U);  // a tetrahedron each
}

TEST(MeshSimplification, HolesStayOpen) {
  for (const std::uint32_t across : {3U, 8U, 16U}) {
    const TriangleMesh least = simplified(torus(3.0, 0.5, 60, across), 1);
    EXPECT_LT(least.triangles.size(), 100U);
    expect_closed_and_oriented(least);
    EXPECT_EQ(euler_characteristic(least), 0);
  }
}

TEST(MeshSimplification, BoundsTheWorkOfDecomposition) {
  const TriangleMesh ring = torus(3.0, 1.0, 600, 200);
  ASSERT_GT(ring.triangles.size(), 200'000U);
  const auto parts = decompose_convex(ring, {});
  std::size_t points = 0;
  double volume = 0.0;
  for (const auto& part : parts) {
    points += part.size();
    volume += hull_volume(part);
  }
  EXPECT_LT(points, 2 * kMaxDecomposedTriangles);
  EXPECT_LE(parts.size(), 32U);
  EXPECT_NEAR(volume / volume_of(ring), 1.0, 0.02);
}

}  // namespace
}  // namespace smartsurf::mesh

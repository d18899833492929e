#include "smartsurf/view/model/Meshes.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

namespace smartsurf::view {
namespace {

Eigen::Vector3d vertex(const Mesh& mesh, std::uint32_t i) {
  const float* p = &mesh.vertices[6 * i];
  return {p[0], p[1], p[2]};
}
Eigen::Vector3d normal(const Mesh& mesh, std::uint32_t i) {
  const float* p = &mesh.vertices[6 * i + 3];
  return {p[0], p[1], p[2]};
}

// Sum of the signed volumes of the tetrahedra from the origin: correct only if the mesh is closed and every
// triangle faces outwards.
double volume(const Mesh& mesh) {
  double sum = 0.0;
  for (std::size_t t = 0; t < mesh.indices.size(); t += 3)
    sum += vertex(mesh, mesh.indices[t])
               .dot(vertex(mesh, mesh.indices[t + 1]).cross(vertex(mesh, mesh.indices[t + 2])));
  return sum / 6.0;
}

void expect_face_normals(const Mesh& mesh, double min_cosine) {
  for (std::size_t t = 0; t < mesh.indices.size(); t += 3) {
    const Eigen::Vector3d a = vertex(mesh, mesh.indices[t]), b = vertex(mesh, mesh.indices[t + 1]),
                          c = vertex(mesh, mesh.indices[t + 2]);
    const Eigen::Vector3d face = (b - a).cross(c - a);
    if (face.norm() < 1e-3) continue;  // degenerate: at a pole, or between the caps
    for (std::size_t i = 0; i < 3; ++i)
      EXPECT_GT(normal(mesh, mesh.indices[t + i]).dot(face.normalized()), min_cosine);
  }
}

TEST(Meshes, AreClosedAndFaceOutwards) {
  EXPECT_NEAR(volume(box_mesh()), 8.0, 1e-6);
  const double circle = 0.5 * 64 * std::sin(2.0 * M_PI / 64);  // area of the 64-gon
  EXPECT_NEAR(volume(cylinder_mesh(64)), 2.0 * circle, 1e-4);
  EXPECT_NEAR(volume(cone_mesh(64)), circle * (4.0 / 3.0) / 3.0, 1e-4);
  EXPECT_NEAR(volume(capsule_mesh(64)), 4.0 / 3.0 * M_PI, 0.02);
}

TEST(Meshes, NormalsPointOutwards) {
  expect_face_normals(capsule_mesh(64), 0.97);
  for (const Mesh& mesh : {cylinder_mesh(48), cone_mesh(48), box_mesh()})
    for (std::uint32_t i = 0; i < mesh.vertices.size() / 6; ++i) {
      EXPECT_NEAR(normal(mesh, i).norm(), 1.0, 1e-6);
      EXPECT_GE(normal(mesh, i).dot(vertex(mesh, i)), 0.0);
    }
}

TEST(Meshes, CapsuleVerticesBelongToACap) {
  const Mesh mesh = capsule_mesh(24);
  for (std::uint32_t i = 0; i < mesh.vertices.size() / 6; ++i) EXPECT_NE(vertex(mesh, i).z(), 0.0);
  const std::vector<float> wire = capsule_wireframe();
  for (std::size_t i = 2; i < wire.size(); i += 3) EXPECT_NE(wire[i], 0.0f);
}

TEST(Meshes, SolidHasFlatFacesAndUniqueEdges) {
  scene::Solid cube;
  for (int i = 0; i < 8; ++i)
    cube.vertices.push_back(
        {static_cast<float>(i & 1), static_cast<float>(i >> 1 & 1), static_cast<float>(i >> 2)});
  cube.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                    {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  const Mesh mesh = solid_mesh(cube);
  EXPECT_NEAR(volume(mesh), 1.0, 1e-6);
  EXPECT_EQ(mesh.vertices.size() / 6, 36u);
  expect_face_normals(mesh, 0.999);
  EXPECT_EQ(solid_wireframe(cube).size(), 12u * 2 * 3) << "face diagonals are not edges";
}

// A prism over a regular polygon, whose sides meet at 360°/n: up to 8 sides are flat, from 10 sides on round.
TEST(Meshes, FacesThatMeetAtLessThan40DegreesAreCurved) {
  for (std::uint32_t sides = 3; sides < 24; ++sides) {
    if (sides == 9) continue;  // 40°
    scene::Solid prism;
    for (std::uint32_t i = 0; i < sides; ++i)
      for (const float z : {-1.0f, 1.0f}) {
        const double angle = 2.0 * std::numbers::pi * i / sides;
        prism.vertices.push_back(
            {static_cast<float>(std::cos(angle)), static_cast<float>(std::sin(angle)), z});
      }
    for (std::uint32_t i = 0; i < sides; ++i) {
      const std::uint32_t low = 2 * i, next = 2 * ((i + 1) % sides);
      prism.triangles.push_back({low, next, next + 1});
      prism.triangles.push_back({low, next + 1, low + 1});
      if (i > 0 && i + 1 < sides) {
        prism.triangles.push_back({0, next, low});
        prism.triangles.push_back({1, low + 1, next + 1});
      }
    }
    const Mesh mesh = solid_mesh(prism);
    for (std::uint32_t i = 0; i < mesh.vertices.size() / 6; ++i) {
      const Eigen::Vector3d n = normal(mesh, i), at = vertex(mesh, i);
      if (std::abs(n.z()) > 0.5) {
        EXPECT_NEAR(std::abs(n.z()), 1.0, 1e-6) << "a cap stays flat";
        continue;
      }
      const double off_radius = std::acos(std::min(n.dot(Eigen::Vector3d(at.x(), at.y(), 0.0)), 1.0));
      // The two triangles of a side share the weight of its normal, at one of its corners unequally.
      if (sides >= 10)
        EXPECT_LT(off_radius, std::numbers::pi / sides / 2.0) << sides;
      else
        EXPECT_NEAR(off_radius, std::numbers::pi / sides, 1e-3) << sides;
    }
  }
}

}  // namespace
}  // namespace smartsurf::view

#include "smartsurf/mesh/MassProperties.h"

namespace smartsurf::mesh {

void MassProperties::add(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
  const double six_volumes = a.dot(b.cross(c));
  const Eigen::Vector3d sum = a + b + c;
  volume_ += six_volumes / 6.0;
  first_moment_ += six_volumes / 24.0 * sum;
  second_moment_ += six_volumes / 120.0 *
                    (sum * sum.transpose() + a * a.transpose() + b * b.transpose() + c * c.transpose());
}

void MassProperties::add(const TriangleMesh& mesh) {
  for (const auto& t : mesh.triangles) add(mesh.points[t[0]], mesh.points[t[1]], mesh.points[t[2]]);
}

void MassProperties::add(const scene::ConvexHull& hull) {
  const auto corner = [&](std::uint32_t i) {
    return hull.vertices[hull.face_vertices[i]].cast<double>().eval();
  };
  for (const auto& face : hull.faces)
    for (std::uint32_t i = 1; i + 1 < face.vertex_count; ++i)
      add(corner(face.first_vertex), corner(face.first_vertex + i), corner(face.first_vertex + i + 1));
}

Eigen::Matrix3d MassProperties::inertia(const Eigen::Vector3d& about) const {
  const Eigen::Matrix3d cross = first_moment_ * about.transpose();
  const Eigen::Matrix3d moved =
      second_moment_ - cross - cross.transpose() + volume_ * about * about.transpose();
  return moved.trace() * Eigen::Matrix3d::Identity() - moved;
}

}  // namespace smartsurf::mesh

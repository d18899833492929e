#include "smartsurf/scene/Axes.h"

#include <Eigen/Eigenvalues>
#include <cmath>

namespace smartsurf::scene {

Eigen::Quaterniond rotation_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  const Eigen::Vector3d a = from.normalized(), b = to.normalized();
  const double cosine = b.dot(a);
  Eigen::Quaterniond rotation;
  if (cosine > -1 + 1e-12) {
    const double two_w = std::sqrt(2 * (1 + cosine));
    rotation.w() = 0.5 * two_w;
    rotation.vec() = a.cross(b) * (1 / two_w);
  } else {
    // The cosine does not tell how far the two are from opposite.
    constexpr double kLeast = 1e-9;  // of w, where the cross product still has a direction
    const double w = 0.5 * (a + b).norm();
    rotation.w() = w > kLeast ? w : 0;
    // For z, half a turn about x, as MuJoCo has it.
    const Eigen::Vector3d beside =
        std::abs(a.y()) < 0.7 ? Eigen::Vector3d::UnitY() : Eigen::Vector3d::UnitX();
    const Eigen::Vector3d axis = (w > kLeast ? a.cross(b) : beside.cross(a)).normalized();
    rotation.vec() = axis * std::sqrt(1 - w * w);
  }
  return rotation;
}

PrincipalAxes principal_axes(const Eigen::Matrix3d& symmetric) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(symmetric);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

}  // namespace smartsurf::scene

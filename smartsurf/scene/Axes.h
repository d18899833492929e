// Rotations between directions, and principal axes. Eigen's decompositions are slow to compile: only this
// unit calls one, and its rotation between directions does without the singular values of Eigen's.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace smartsurf::scene {

// The smallest rotation from the direction of `from` to that of `to`, which may have any length but 0. Where
// they are opposite, it is about some axis perpendicular to them.
Eigen::Quaterniond rotation_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to);

struct PrincipalAxes {
  Eigen::Vector3d moments;  // ascend
  Eigen::Matrix3d axes;     // columns: unit vectors, one for each moment; may be left-handed
};

// Diagonalises a symmetric matrix, such as an inertia tensor; reads its lower triangle.
PrincipalAxes principal_axes(const Eigen::Matrix3d& symmetric);

}  // namespace smartsurf::scene

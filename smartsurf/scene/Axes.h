// Rotations between directions, and principal axes. The decompositions behind them are the largest of Eigen's
// templates, and are compiled in this unit alone.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace smartsurf::scene {

// The shortest rotation that turns the direction `from` into `to`; of opposite ones, about some axis
// perpendicular to them.
Eigen::Quaterniond rotation_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to);

struct PrincipalAxes {
  Eigen::Vector3d moments;  // ascend
  Eigen::Matrix3d axes;     // columns: unit vectors, one for each moment; may be left-handed
};

// Of a symmetric matrix, such as an inertia tensor.
PrincipalAxes principal_axes(const Eigen::Matrix3d& symmetric);

}  // namespace smartsurf::scene

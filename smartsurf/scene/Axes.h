// Turns and principal axes. Their decompositions are the largest of Eigen's templates: here they are compiled
// once.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace smartsurf::scene {

// The shortest rotation that turns the direction `from` into `to`; of opposite ones, one about an axis across
// them.
Eigen::Quaterniond rotation_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to);

struct PrincipalAxes {
  Eigen::Vector3d moments;  // ascend
  Eigen::Matrix3d axes;     // columns, of length 1: the axis of each moment; left- or right-handed
};

// Of a symmetric matrix, such as an inertia tensor.
PrincipalAxes principal_axes(const Eigen::Matrix3d& symmetric);

}  // namespace smartsurf::scene

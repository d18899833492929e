// The vectors of the physics: single precision, right-handed, lengths in u.
#pragma once

#include <Eigen/Geometry>

namespace smartsurf::world {

using Vec3 = Eigen::Vector3f;
using Mat3 = Eigen::Matrix3f;
using Quat = Eigen::Quaternionf;

}  // namespace smartsurf::world

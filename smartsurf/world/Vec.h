// The vectors of the physics: single precision, right-handed, lengths in u.
#pragma once

#include <Eigen/Geometry>
#include <cmath>

namespace smartsurf::world {

using Vec3 = Eigen::Vector3f;
using Mat3 = Eigen::Matrix3f;
using Quat = Eigen::Quaternionf;

// Of a vector in the plane; where the sizes are a scene's, nothing overflows that std::hypot would save.
inline float length_of(float x, float y) { return std::sqrt(x * x + y * y); }

}  // namespace smartsurf::world

// Vector types of the physics: single precision, right-handed, z up, lengths in u.
#pragma once

#include <Eigen/Geometry>
#include <cmath>

#include "common/index/Index.h"

namespace smartsurf::world {

using common::Index;
using Vec3 = Eigen::Vector3f;
using Mat3 = Eigen::Matrix3f;
using Quat = Eigen::Quaternionf;

// Euclidean norm. Lengths of scene size cannot overflow, so std::hypot would only be slower.
inline float length_of(float x, float y) { return std::sqrt(x * x + y * y); }

}  // namespace smartsurf::world

// Small functions that the path tracer's files share.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>

namespace smartsurf::view {

inline Eigen::Vector3f vec(const std::array<float, 3>& v) { return {v[0], v[1], v[2]}; }

// GLSL's smoothstep.
inline float smoothstep(float from, float to, float x) {
  const float t = std::clamp((x - from) / (to - from), 0.0F, 1.0F);
  return t * t * (3.0F - 2.0F * t);
}

}  // namespace smartsurf::view

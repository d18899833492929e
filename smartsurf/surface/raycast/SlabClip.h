// Clips a ray to a slab about the origin, one axis at a time. Private to smartsurf/surface/raycast.
#pragma once

#include <algorithm>
#include <cmath>

namespace smartsurf::surface {

// An interval of the ray parameter. Empty if t_enter > t_exit.
struct TInterval {
  float t_enter, t_exit;
};

// Clips `t` to the slab |u| ≤ half, where u = origin + t·direction. Returns whether anything is left.
inline bool clip_slab(float origin, float direction, float half, TInterval& t) {
  if (direction == 0.0F) return std::abs(origin) <= half;
  const float a = (-half - origin) / direction, b = (half - origin) / direction;
  t.t_enter = std::max(t.t_enter, std::min(a, b));
  t.t_exit = std::min(t.t_exit, std::max(a, b));
  return t.t_enter <= t.t_exit;
}

}  // namespace smartsurf::surface

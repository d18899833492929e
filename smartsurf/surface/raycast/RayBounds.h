// Conservative bounds of the cells that a ray cast has to test. Private to smartsurf/surface/raycast.
#pragma once

#include <algorithm>
#include <cmath>

namespace smartsurf::surface {

struct ScalarRange {
  float low, high;
  bool empty() const { return !(low <= high); }
};

// The start coordinates along one axis from which a ray comes within `reach` of `centre` for some parameter
// in t. Widened by the rounding error.
inline ScalarRange start_range(float centre, float reach, float direction, const ScalarRange& t) {
  const float a = direction * t.low, b = direction * t.high;
  const float slack = 1e-5F * (std::abs(centre) + std::abs(a) + std::abs(b) + reach);
  return {centre - reach - std::max(a, b) - slack, centre + reach - std::min(a, b) + slack};
}

// The first index ≥ u, and one past the last index ≤ u, clamped to [0, count].
inline int first_index_from(float u, int count) {
  return static_cast<int>(std::ceil(std::clamp(u, 0.0F, static_cast<float>(count))));
}
inline int end_index_at(float u, int count) {
  return static_cast<int>(std::floor(std::clamp(u, -1.0F, static_cast<float>(count - 1)))) + 1;
}

}  // namespace smartsurf::surface

// Which cells a sweep need try. Internal to the room.
#pragma once

#include <algorithm>
#include <cmath>

namespace smartsurf::surface {

struct ScalarRange {
  float low, high;
  bool empty() const { return !(low <= high); }
};

// Where along one axis a segment must start to be within `reach` of the centre at a distance in t.
inline ScalarRange start_range(float centre, float reach, float direction, const ScalarRange& t) {
  const float a = direction * t.low, b = direction * t.high;
  const float slack = 1e-5F * (std::abs(centre) + std::abs(a) + std::abs(b) + reach);
  return {centre - reach - std::max(a, b) - slack, centre + reach - std::min(a, b) + slack};
}

// The first index at or after u, and one more than the last at or before it, within [0, most].
inline int first_index_from(float u, int count) {
  return static_cast<int>(std::ceil(std::clamp(u, 0.0F, static_cast<float>(count))));
}
inline int end_index_at(float u, int count) {
  return static_cast<int>(std::floor(std::clamp(u, -1.0F, static_cast<float>(count - 1)))) + 1;
}

}  // namespace smartsurf::surface

// Which cells a sweep need try. Internal to the room.
#pragma once

#include <algorithm>
#include <cmath>

namespace smartsurf::surface {

struct Range {
  float low, high;
  bool empty() const { return !(low <= high); }
};

// Where along one axis a segment must start to be within `reach` of the centre at a distance in t.
inline Range starts(float centre, float reach, float along, const Range& t) {
  const float a = along * t.low, b = along * t.high;
  const float slack = 1e-5F * (std::abs(centre) + std::abs(a) + std::abs(b) + reach);
  return {centre - reach - std::max(a, b) - slack, centre + reach - std::min(a, b) + slack};
}

// The first index at or after u, and one more than the last at or before it, within [0, most].
inline int first_from(float u, int most) {
  return static_cast<int>(std::ceil(std::clamp(u, 0.0F, static_cast<float>(most))));
}
inline int end_at(float u, int most) {
  return static_cast<int>(std::floor(std::clamp(u, -1.0F, static_cast<float>(most - 1)))) + 1;
}

}  // namespace smartsurf::surface

// Vectors as rows of four floats, the last of which does not count, for code that moves one body at a time: a
// body's row (BodyRows.h) is two of them. Sums are in Eigen's order, so that rows give the bits that Vec3
// gives.
#pragma once

#include "smartsurf/world/body/Vec.h"
#include "smartsurf/world/simd/Simd4.h"

namespace smartsurf::world {

inline Float4 to_row(const Vec3& v) { return Float4{v.x(), v.y(), v.z(), 0.0F}; }
inline Vec3 from_row(const Float4& r) { return {r[0], r[1], r[2]}; }
// The last components do not count.
inline float dot(const Float4& a, const Float4& b) {
  const Float4 product = a * b;
  return product[0] + (product[1] + product[2]);
}
inline Float4 cross(const Float4& a, const Float4& b) {
  const auto yzx = [](const Float4& v) { return __builtin_shufflevector(v, v, 1, 2, 0, 3); };
  const auto zxy = [](const Float4& v) { return __builtin_shufflevector(v, v, 2, 0, 1, 3); };
  return yzx(a) * zxy(b) - zxy(a) * yzx(b);
}

}  // namespace smartsurf::world

// Four-lane float vectors as compiler vector types, for loops too short for Highway's dynamic dispatch.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>

namespace smartsurf::world {

inline constexpr int kSimd4Width = 4;
using Float4 [[gnu::vector_size(16)]] = float;
using Int4 [[gnu::vector_size(16)]] = std::int32_t;

inline Float4 load4(const float* from) {
  Float4 v;
  std::memcpy(&v, from, sizeof(v));
  return v;
}
inline Int4 load4(const std::int32_t* from) {
  Int4 v;
  std::memcpy(&v, from, sizeof(v));
  return v;
}
inline void store4(const Float4& v, float* to) { std::memcpy(to, &v, sizeof(v)); }
inline void transpose4(Float4& a, Float4& b, Float4& c, Float4& d) {
  const Float4 ab_low = __builtin_shufflevector(a, b, 0, 4, 1, 5),
               ab_high = __builtin_shufflevector(a, b, 2, 6, 3, 7),
               cd_low = __builtin_shufflevector(c, d, 0, 4, 1, 5),
               cd_high = __builtin_shufflevector(c, d, 2, 6, 3, 7);
  a = __builtin_shufflevector(ab_low, cd_low, 0, 1, 4, 5);
  b = __builtin_shufflevector(ab_low, cd_low, 2, 3, 6, 7);
  c = __builtin_shufflevector(ab_high, cd_high, 0, 1, 4, 5);
  d = __builtin_shufflevector(ab_high, cd_high, 2, 3, 6, 7);
}
inline Float4 broadcast4(float value) { return Float4{} + value; }
// min and max return the second operand if either is NaN.
inline Float4 min(const Float4& a, const Float4& b) { return a < b ? a : b; }
inline Float4 max(const Float4& a, const Float4& b) { return a > b ? a : b; }
inline Float4 abs(const Float4& v) { return v < 0.0F ? -v : v; }
inline Float4 sqrt(const Float4& v) {
  return Float4{std::sqrt(v[0]), std::sqrt(v[1]), std::sqrt(v[2]), std::sqrt(v[3])};
}
inline Int4 as_int_bits(const Float4& v) {
  Int4 n;
  std::memcpy(&n, &v, sizeof(n));
  return n;
}
// True if any lane of a comparison's result is set.
inline bool any_of(const Int4& v) {
  std::int64_t halves[2];
  std::memcpy(halves, &v, sizeof(v));
  return (halves[0] | halves[1]) != 0;
}
template <class T>
auto horizontal_max(const T& v) {
  const auto a = v[0] > v[1] ? v[0] : v[1], b = v[2] > v[3] ? v[2] : v[3];
  return a > b ? a : b;
}
template <class T>
auto horizontal_min(const T& v) {
  const auto a = v[0] < v[1] ? v[0] : v[1], b = v[2] < v[3] ? v[2] : v[3];
  return a < b ? a : b;
}

// Calls each(i) for groups [i, i + 4) that cover [0, count); the last one may overlap its predecessor.
// Precondition: count ≥ 4.
template <class Each>
inline void for_each_simd4(int count, Each each) {
  for (int i = 0; i < count; i += kSimd4Width) each(i < count - kSimd4Width ? i : count - kSimd4Width);
}

}  // namespace smartsurf::world

// Four floats at a time, as the compiler's own vectors: for jobs too short for a call through Highway's table
// of instruction sets.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>

namespace smartsurf::world {

inline constexpr int kFour = 4;
using Floats [[gnu::vector_size(16)]] = float;
using Ints [[gnu::vector_size(16)]] = std::int32_t;

inline Floats load_four(const float* from) {
  Floats v;
  std::memcpy(&v, from, sizeof(v));
  return v;
}
inline Floats four_of(float value) { return Floats{} + value; }
// The second where either is not a number.
inline Floats min(const Floats& a, const Floats& b) { return a < b ? a : b; }
inline Floats max(const Floats& a, const Floats& b) { return a > b ? a : b; }
inline Floats abs(const Floats& v) { return v < 0.0F ? -v : v; }
inline Floats sqrt(const Floats& v) {
  return Floats{std::sqrt(v[0]), std::sqrt(v[1]), std::sqrt(v[2]), std::sqrt(v[3])};
}
inline Ints bits(const Floats& v) {
  Ints n;
  std::memcpy(&n, &v, sizeof(n));
  return n;
}
template <class T>
auto greatest_of(const T& v) {
  const auto a = v[0] > v[1] ? v[0] : v[1], b = v[2] > v[3] ? v[2] : v[3];
  return a > b ? a : b;
}

// Calls four(i) for groups that cover [0, count) between them, count ≥ 4: the last one may overlap.
template <class Four>
inline void for_fours(int count, Four four) {
  for (int i = 0; i < count; i += kFour) four(i < count - kFour ? i : count - kFour);
}

}  // namespace smartsurf::world

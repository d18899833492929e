// The values of the controller's scalars: whole numbers up to 2^53 are exact, all others are 32-bit floats, as the
// cells of registers are.
#pragma once

#include <cmath>

namespace apron::program {

inline constexpr double kMaxWholeScalar = 9007199254740992.0;  // 2^53

inline bool is_whole_scalar(double value) noexcept {
  return std::fabs(value) <= kMaxWholeScalar && value == std::trunc(value);
}

// The scalar that holds the result of an operation.
inline double to_scalar(double value) noexcept {
  return is_whole_scalar(value) ? value : static_cast<double>(static_cast<float>(value));
}

// a - b*floor(a/b): exact for whole numbers, otherwise with the roundings of 32-bit floats.
inline double modulo(double a, double b) noexcept {
  if (is_whole_scalar(a) && is_whole_scalar(b)) return to_scalar(a - b * std::floor(a / b));
  const float x = static_cast<float>(a), y = static_cast<float>(b);
  return x - y * std::floor(x / y);
}

}  // namespace apron::program

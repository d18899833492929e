#include "apron/vm/NumberFormat.h"

#include <charconv>
#include <cmath>

#include "apron/program/ScalarArithmetic.h"

namespace apron::vm {

std::string_view format_number(float value, NumberBuffer& buffer) noexcept {
  if (std::isnan(value)) return "nan";  // the sign of a NaN depends on the CPU
  const float size = std::fabs(value);
  const bool plain = size == 0.0F || (size >= 1e-4F && size < 1e9F);
  const auto format = plain ? std::chars_format::fixed : std::chars_format::general;
  const auto end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value, format).ptr;
  return std::string_view(buffer.data(), end - buffer.data());
}

std::string_view format_number(double value, NumberBuffer& buffer) noexcept {
  constexpr double kFirstInexact = 16777216.0;  // 2^24
  if (std::fabs(value) <= kFirstInexact || !program::is_whole_scalar(value))
    return format_number(static_cast<float>(value), buffer);
  const auto end =
      std::to_chars(buffer.data(), buffer.data() + buffer.size(), value, std::chars_format::fixed).ptr;
  return std::string_view(buffer.data(), end - buffer.data());
}

std::string format_number(double value) {
  NumberBuffer buffer;
  return std::string(format_number(value, buffer));
}

std::string format_number(float value) {
  NumberBuffer buffer;
  return std::string(format_number(value, buffer));
}

}  // namespace apron::vm

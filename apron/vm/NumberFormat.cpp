#include "apron/vm/NumberFormat.h"

#include <charconv>
#include <cmath>

namespace apron::vm {

std::string_view format_number(float value, NumberBuffer& buffer) noexcept {
  if (std::isnan(value)) return "nan";  // the sign of a NaN depends on the CPU
  const float size = std::fabs(value);
  const bool plain = size == 0.0F || (size >= 1e-4F && size < 1e9F);
  const auto format = plain ? std::chars_format::fixed : std::chars_format::general;
  const auto end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value, format).ptr;
  return {buffer.data(), static_cast<std::size_t>(end - buffer.data())};
}

std::string format_number(float value) {
  NumberBuffer buffer;
  return std::string(format_number(value, buffer));
}

}  // namespace apron::vm

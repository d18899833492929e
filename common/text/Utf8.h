// Reads texts in UTF-8.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

namespace common {

struct CodePoint {
  std::uint32_t code = 0;
  std::size_t bytes = 0;  // 0: not UTF-8
};

inline constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
inline std::string_view without_byte_order_mark(std::string_view text) noexcept {
  return text.starts_with(kByteOrderMark) ? text.substr(kByteOrderMark.size()) : text;
}

// Decodes the first character. Precondition: the text is not empty.
CodePoint decode_utf8(std::string_view) noexcept;

}  // namespace common

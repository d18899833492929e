// A size given as text: WIDTHxHEIGHT.
#pragma once

#include <charconv>
#include <optional>
#include <string_view>

namespace common {

struct PixelSize {
  int width = 0, height = 0;
};

// "1280x720" → {1280, 720}; nothing else is accepted, 0 and signs included.
inline std::optional<PixelSize> parse_size(std::string_view text) {
  PixelSize size;
  const std::size_t x = text.find('x');
  if (x == std::string_view::npos) return std::nullopt;
  const auto number = [](std::string_view digits, int& value) {
    const char* const end = digits.data() + digits.size();
    const auto [rest, error] = std::from_chars(digits.data(), end, value);
    return error == std::errc{} && rest == end && value > 0;
  };
  if (!number(text.substr(0, x), size.width) || !number(text.substr(x + 1), size.height)) return std::nullopt;
  return size;
}

}  // namespace common

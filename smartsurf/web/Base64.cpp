#include "smartsurf/web/Base64.h"

#include <cstddef>

namespace smartsurf::web {

std::string base64(std::span<const std::uint8_t> bytes) {
  static constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t left = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t block = 0;
    for (std::size_t b = 0; b < 3; ++b) block = block << 8 | (b < left ? bytes[i + b] : 0u);
    for (std::size_t d = 0; d < 4; ++d) text += d <= left ? kDigits[block >> (18 - 6 * d) & 63] : '=';
  }
  return text;
}

}  // namespace smartsurf::web

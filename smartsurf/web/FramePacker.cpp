#include "smartsurf/web/FramePacker.h"

#include <zlib.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <stdexcept>

namespace smartsurf::web {
namespace {

// The greatest number that a value can have; one more says that there is none.
std::uint16_t greatest(int bytes) { return static_cast<std::uint16_t>(bytes == 1 ? 0xFE : 0xFFFE); }

}  // namespace

void SeriesPacker::add(std::span<const float> frame) {
  assert(frame.size() == layout_.values);
  const std::uint16_t most = greatest(layout_.bytes);
  const double scale = most / std::max(layout_.high - layout_.low, 1e-12);
  const std::size_t first = bytes_.size(), stride = frame.size();
  bytes_.resize(first + stride * static_cast<std::size_t>(layout_.bytes));
  for (std::size_t i = 0; i < stride; ++i) {
    const double at = std::clamp((double{frame[i]} - layout_.low) * scale, 0.0, static_cast<double>(most));
    const auto value = static_cast<std::uint16_t>(std::isnan(frame[i]) ? most + 1 : std::lround(at));
    const auto change = static_cast<std::uint16_t>(value - last_[i]);
    last_[i] = value;
    // Low bytes of a frame together, then its high bytes: the high ones are mostly 0.
    bytes_[first + i] = static_cast<std::uint8_t>(change & 0xFF);
    if (layout_.bytes == 2) bytes_[first + stride + i] = static_cast<std::uint8_t>(change >> 8);
  }
}

std::vector<std::uint8_t> compress(std::span<const std::uint8_t> bytes) {
  uLongf length = compressBound(bytes.size());
  std::vector<std::uint8_t> packed(length);
  if (compress2(packed.data(), &length, bytes.data(), bytes.size(), Z_DEFAULT_COMPRESSION) != Z_OK)
    throw std::runtime_error("zlib cannot compress " + std::to_string(bytes.size()) + " bytes");
  packed.resize(length);
  return packed;
}

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

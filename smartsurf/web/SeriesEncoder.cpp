#include "smartsurf/web/SeriesEncoder.h"

#include <zlib.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <stdexcept>

namespace smartsurf::web {
namespace {

// The largest code of a value; the next code means "no value".
std::uint32_t max_code_for(int bytes) { return (0xFFFFFFFFU >> (32 - 8 * bytes)) - 1; }

}  // namespace

void SeriesEncoder::add(std::span<const float> frame) {
  assert(frame.size() == layout_.values_per_frame);
  const std::uint32_t max_code = max_code_for(layout_.bytes_per_value);
  const double scale = max_code / std::max(layout_.high - layout_.low, 1e-12);
  const std::size_t first = bytes_.size(), stride = frame.size();
  bytes_.resize(first + stride * layout_.bytes_per_value);
  for (std::size_t i = 0; i < stride; ++i) {
    const double scaled =
        std::clamp((double{frame[i]} - layout_.low) * scale, 0.0, static_cast<double>(max_code));
    const auto code = std::isnan(frame[i]) ? max_code + 1 : static_cast<std::uint32_t>(std::llround(scaled));
    const std::uint32_t delta = code - last_[i];
    last_[i] = code;
    // All low bytes of a frame, then all higher ones, which are mostly 0 and compress well.
    for (int byte = 0; byte < layout_.bytes_per_value; ++byte)
      bytes_[first + byte * stride + i] = static_cast<std::uint8_t>(delta >> 8 * byte);
  }
}

std::vector<std::uint8_t> compress(std::span<const std::uint8_t> bytes) {
  uLongf length = compressBound(bytes.size());
  std::vector<std::uint8_t> compressed(length);
  if (compress2(compressed.data(), &length, bytes.data(), bytes.size(), Z_DEFAULT_COMPRESSION) != Z_OK)
    throw std::runtime_error("zlib cannot compress " + std::to_string(bytes.size()) + " bytes");
  compressed.resize(length);
  return compressed;
}

}  // namespace smartsurf::web

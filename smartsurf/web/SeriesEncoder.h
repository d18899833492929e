// Encodes frames for the page: values quantised to 8 or 16 bits, frames as differences from the previous one,
// compressed, base64. Internal to this module.
//
// Arrays are stored one after another, because similar data compress better together.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace smartsurf::web {

// One array of frames × values in the stream.
struct SeriesLayout {
  double low = 0.0, high = 1.0;  // what 0 and the greatest number stand for
  int bytes_per_value = 2;  // a value: 1 or 2, unsigned, little-endian; the greatest stands for "no value"
  std::size_t values_per_frame = 0;  // a frame
};

// Values below low or above high are rounded to these; a NaN becomes "no value".
class SeriesEncoder {
 public:
  explicit SeriesEncoder(const SeriesLayout& layout) : layout_(layout), last_(layout.values_per_frame) {}

  // frame.size() must be layout.values.
  void add(std::span<const float> frame);
  const SeriesLayout& layout() const { return layout_; }
  const std::vector<std::uint8_t>& bytes() const { return bytes_; }

 private:
  SeriesLayout layout_;
  std::vector<std::uint16_t> last_;
  std::vector<std::uint8_t> bytes_;
};

// zlib's format, which browsers call "deflate".
std::vector<std::uint8_t> compress(std::span<const std::uint8_t> bytes);
std::string base64(std::span<const std::uint8_t> bytes);

}  // namespace smartsurf::web

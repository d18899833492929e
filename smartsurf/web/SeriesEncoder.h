// Encodes frames for the page: values are quantized to 8, 16 or 32 bits, delta-encoded between frames
// and compressed. Internal to this module.
//
// Arrays are stored one after another, because similar data compress better together.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace smartsurf::web {

// Layout of one array in the stream, frames × values.
struct SeriesLayout {
  double low = 0.0, high = 1.0;  // values of code 0 and of the largest code
  int bytes_per_value = 2;       // 1, 2 or 4; unsigned, with all bits set = no value
  std::size_t values_per_frame = 0;
};

// Clamps values to [low, high]. NaN is encoded as "no value".
class SeriesEncoder {
 public:
  explicit SeriesEncoder(const SeriesLayout& layout) : layout_(layout), last_(layout.values_per_frame) {}

  // Requires frame.size() == layout.values_per_frame.
  void add(std::span<const float> frame);
  const SeriesLayout& layout() const { return layout_; }
  const std::vector<std::uint8_t>& bytes() const { return bytes_; }

 private:
  SeriesLayout layout_;
  std::vector<std::uint32_t> last_;
  std::vector<std::uint8_t> bytes_;
};

// Compresses to the zlib format, which browsers call "deflate". Throws std::runtime_error on failure.
std::vector<std::uint8_t> compress(std::span<const std::uint8_t> bytes);

}  // namespace smartsurf::web

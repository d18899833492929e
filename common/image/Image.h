// An 8-bit RGB image in memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace common {

struct Image {
  int width = 0, height = 0;      // pixels
  std::vector<std::uint8_t> rgb;  // height × width × 3, row-major, row 0 at the top, sRGB

  const std::uint8_t* pixel(int x, int y) const { return &rgb[(std::ptrdiff_t{y} * width + x) * 3]; }
};

}  // namespace common

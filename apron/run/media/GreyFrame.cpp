#include "apron/run/media/GreyFrame.h"

#include <algorithm>

namespace apron::run {
namespace {

// Along one axis, maps each of `cells` cells to a part of the `size` pixels that start at `first`.
struct CropAxis {
  std::uint64_t first = 0, size = 1, cells = 1;

  std::uint64_t begin(std::uint64_t cell) const { return first + cell * size / cells; }
  std::uint64_t end(std::uint64_t cell) const {
    return std::max(first + (cell + 1) * size / cells, begin(cell) + 1);
  }
};

CropAxis center_crop(std::uint64_t length, std::uint64_t crop_length, std::uint64_t cells) {
  const std::uint64_t size = std::clamp<std::uint64_t>(crop_length, 1, length);
  return {(length - size) / 2, size, cells};
}

}  // namespace

void resample_center_crop(const GreyFrame& frame, const vm::Plane& to) {
  const std::uint64_t width = frame.width, height = frame.height;
  const CropAxis columns = center_crop(width, height * to.width / to.height, to.width);
  const CropAxis rows = center_crop(height, width * to.height / to.width, to.height);
  for (std::uint32_t y = 0; y < to.height; ++y)
    for (std::uint32_t x = 0; x < to.width; ++x) {
      std::uint64_t sum = 0;
      for (std::uint64_t row = rows.begin(y); row < rows.end(y); ++row)
        for (std::uint64_t column = columns.begin(x); column < columns.end(x); ++column)
          sum += frame.pixels[row * width + column];
      const std::uint64_t count = (rows.end(y) - rows.begin(y)) * (columns.end(x) - columns.begin(x));
      to.row(y)[x] = static_cast<float>(sum) / static_cast<float>(count);
    }
}

}  // namespace apron::run

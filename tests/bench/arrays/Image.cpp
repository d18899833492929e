#include <sys/mman.h>

#include <algorithm>
#include <cstdint>
#include <new>

#include "tests/bench/arrays/Peers.h"

namespace arrays {
namespace {

constexpr int kLanes = 16;

std::uint32_t hash(std::uint32_t x) {
  x ^= x >> 16;
  x *= 0x7feb352dU;
  x ^= x >> 15;
  x *= 0x846ca68bU;
  return x ^ (x >> 16);
}

std::uint32_t cell_hash(int row, int column, std::uint32_t a, std::uint32_t b, std::uint32_t c) {
  return hash(static_cast<std::uint32_t>(row) * a + static_cast<std::uint32_t>(column) * b + c);
}

}  // namespace

Image::Image(int rows, int columns) : n_(rows), pitch_((columns + kLanes - 1) / kLanes * kLanes + kLanes) {
  static int made = 0;
  // Large allocations begin on a page boundary. Images are staggered by some cache lines, so that the same
  // cell of all images does not map to one cache set.
  const std::size_t lead = static_cast<std::size_t>(kLanes) * (1 + 5 * static_cast<std::size_t>(made++ % 13));
  const std::size_t floats = lead + static_cast<std::size_t>(pitch_) * (static_cast<std::size_t>(rows) + 3);
  // All peers use huge pages, as NumPy and the VM do.
  constexpr std::size_t kHugePage = std::size_t{1} << 21;
  const std::size_t page = floats * sizeof(float) >= 2 * kHugePage ? kHugePage : 4096;
  const std::size_t bytes = (floats * sizeof(float) + page - 1) / page * page;
  cells_.reset(static_cast<float*>(std::aligned_alloc(page, bytes)));
  if (!cells_) throw std::bad_alloc();
  if (page == kHugePage) madvise(cells_.get(), bytes, MADV_HUGEPAGE);
  std::fill_n(cells_.get(), bytes / sizeof(float), 0.0F);
  first_ = cells_.get() + lead + pitch_;
}

double Image::checksum() const {
  double sum = 0;
  for (int r = 0; r < n_; ++r)
    for (int c = 0; c < n_; ++c) sum += static_cast<double>(row(r)[c]) * (1.0 + (r * 7 + c * 3) % 11 * 0.1);
  return sum;
}

float uniform(int row, int column, int which) {
  const std::uint32_t h =
      cell_hash(row, column, 9781U, 6271U * 17U, static_cast<std::uint32_t>(which) * 7919U * 131U);
  return 0.1F + 0.9F * static_cast<float>(h >> 8) * (1.0F / 16777216.0F);
}

float disc_pattern(int row, int column) {
  constexpr int kApart = 32;
  for (int i = -1; i <= 1; ++i)
    for (int j = -1; j <= 1; ++j) {
      const int r = row / kApart + i, c = column / kApart + j;
      const std::uint32_t h = cell_hash(r, c, 131U, 7777U, 5U);
      const int y = row - (r * kApart + 8 + static_cast<int>(h & 15U));
      const int x = column - (c * kApart + 8 + static_cast<int>((h >> 4) & 15U));
      const int radius = 4 + static_cast<int>((h >> 8) & 7U);
      if (y * y + x * x < radius * radius) return 1.0F;
    }
  return 0.0F;
}

float random_life(int row, int column) {
  return (cell_hash(row, column, 4001U, 77U, 99U) & 7U) < 3 ? 1.0F : 0.0F;
}

int inputs(int workload) { return workload <= 2 ? 2 : 1; }

Image input(int workload, int n, int which) {
  Image image(n);
  for (int r = 0; r < n; ++r)
    for (int c = 0; c < n; ++c)
      image.row(r)[c] = workload == 3 || workload == 6 ? disc_pattern(r, c)
                        : workload == 4                ? random_life(r, c)
                                                       : uniform(r, c, which);
  return image;
}

}  // namespace arrays

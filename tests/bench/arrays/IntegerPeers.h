// Hand-written C++ of the workloads of bench_integers.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace arrays {

// n x n bytes with zeros around them, at least 64 on each side.
struct ByteImage {
  static constexpr int kMargin = 64;
  explicit ByteImage(int side)
      : n(side),
        pitch((side + 63) / 64 * 64 + 2 * kMargin),
        cells(static_cast<std::size_t>(pitch) * (side + 8)) {}
  std::uint8_t* row(int r) { return cells.data() + static_cast<std::ptrdiff_t>(r + 4) * pitch + kMargin; }
  const std::uint8_t* row(int r) const {
    return cells.data() + static_cast<std::ptrdiff_t>(r + 4) * pitch + kMargin;
  }
  // Vectors write beyond the last column.
  void clear_margin(int r) {
    for (int x = n; x < n + kMargin; ++x) row(r)[x] = 0;
  }
  int n, pitch;
  std::vector<std::uint8_t> cells;
};

void hand_life(const ByteImage& a, ByteImage& y);
void hand_census(const ByteImage& a, ByteImage& y);
void hand_fast9(const ByteImage& a, ByteImage& y, int threshold);

}  // namespace arrays

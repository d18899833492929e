#include "apron/vm/kernels/FloodFill.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <limits>
#include <type_traits>

namespace apron::vm {

void ConnectedComponents::reserve(std::uint32_t width, std::uint32_t height) {
  runs_.reserve(std::max(runs_.capacity(), (std::size_t{width} + 1) / 2 * height));
  values_.reserve(runs_.capacity());
  row_starts_.reserve(std::max(row_starts_.capacity(), std::size_t{height} + 1));
  truths_.resize(std::max(truths_.size(), std::size_t{width} / 64 + 1));
  edges_.resize(std::max(edges_.size(), std::size_t{width} + 64));
}

std::uint32_t ConnectedComponents::find_root(std::uint32_t run) noexcept {
  while (runs_[run].parent != run) {
    runs_[run].parent = runs_[runs_[run].parent].parent;
    run = runs_[run].parent;
  }
  return run;
}

// Unites each run of the current row, [this_row, end), with the overlapping runs of the row above,
// [row_above, this_row).
void ConnectedComponents::union_with_row_above(std::uint32_t row_above, std::uint32_t this_row) noexcept {
  const auto end = static_cast<std::uint32_t>(runs_.size());
  for (std::uint32_t a = row_above, b = this_row; a < this_row && b < end;) {
    if (runs_[a].last > runs_[b].first && runs_[b].last > runs_[a].first) {
      const std::uint32_t ra = find_root(a), rb = find_root(b);
      // The earlier run is the root.
      const std::uint32_t to = std::min(ra, rb), from = std::max(ra, rb);
      values_[to] = std::max(values_[ra], values_[rb]);
      runs_[from].parent = to;
    }
    const bool above_ends_first = runs_[a].last < runs_[b].last;
    a += above_ends_first ? 1 : 0;
    b += above_ends_first ? 0 : 1;
  }
}

// Finds the columns where runs of true cells begin and end, in turns, and returns their number.
std::size_t ConnectedComponents::find_edges(ConstPlane mask, std::uint32_t row,
                                            const KernelTable& kernels) noexcept {
  kernels.truths[static_cast<std::size_t>(mask.type)](mask.row_bytes(row), mask.width, truths_.data());
  std::size_t count = 0;
  std::uint64_t last = 0;  // the last cell of the word before
  for (std::uint32_t x = 0; x < mask.width; x += 64) {
    const std::uint64_t word = truths_[x / 64];
    for (std::uint64_t edges = word ^ (word << 1U | last); edges != 0; edges &= edges - 1)
      edges_[count++] = x + static_cast<std::uint32_t>(std::countr_zero(edges));
    last = word >> 63U;
  }
  if (last != 0) edges_[count++] = mask.width;
  return count;
}

// Afterwards each run's parent is its root.
template <class Value>
void ConnectedComponents::label_components(ConstPlane mask, const KernelTable& kernels,
                                           const Value& value) noexcept {
  runs_.clear();
  values_.clear();
  row_starts_.clear();
  std::uint32_t row_above = 0;
  for (std::uint32_t y = 0; y < mask.height; ++y) {
    const auto this_row = static_cast<std::uint32_t>(runs_.size());
    row_starts_.push_back(this_row);
    const std::size_t edges = find_edges(mask, y, kernels);
    for (std::size_t i = 0; i < edges; i += 2) {
      runs_.push_back({edges_[i], edges_[i + 1], static_cast<std::uint32_t>(runs_.size())});
      values_.push_back(value(y, edges_[i], edges_[i + 1]));
    }
    union_with_row_above(row_above, this_row);
    row_above = this_row;
  }
  row_starts_.push_back(static_cast<std::uint32_t>(runs_.size()));
  for (Run& run : runs_) run.parent = runs_[run.parent].parent;  // a parent is earlier
}

// Fills the cells [first, last) of a row, and others up to `end`, which are written later.
template <class T>
void fill_ahead(T* row, std::uint32_t first, std::uint32_t last, std::uint32_t end, T value) noexcept {
  constexpr std::uint32_t kChunk = 32 / sizeof(T);
  std::array<T, kChunk> chunk;
  chunk.fill(value);
  std::uint32_t x = first;
  for (; x < last && x + kChunk <= end; x += kChunk) std::memcpy(row + x, chunk.data(), sizeof chunk);
  if (x < last) std::fill(row + x, row + last, value);
}

template <class T>
void ConnectedComponents::write_values(Plane y) noexcept {
  using Whole = std::conditional_t<std::is_integral_v<T>, std::int64_t, T>;
  for (std::uint32_t row = 0; row < y.height; ++row) {
    T* to = y.cells<T>(row);
    std::uint32_t written = 0;
    for (std::uint32_t run = row_starts_[row]; run < row_starts_[row + 1]; ++run) {
      const auto [first, last, root] = runs_[run];
      fill_ahead(to, written, first, y.width, T{0});
      fill_ahead(to, first, last, y.width, static_cast<T>(static_cast<Whole>(values_[root])));
      written = last;
    }
    fill_ahead(to, written, y.width, y.width, T{0});
  }
}

void ConnectedComponents::flood(Plane y, ConstPlane seed, ConstPlane mask,
                                const KernelTable& kernels) noexcept {
  label_components(mask, kernels, [](std::uint32_t, std::uint32_t, std::uint32_t) { return 0.0; });
  for (std::uint32_t row = 0; row < seed.height; ++row) {
    const std::size_t edges = find_edges(seed, row, kernels);
    std::size_t i = 0;
    for (std::uint32_t run = row_starts_[row]; run < row_starts_[row + 1] && i < edges; ++run) {
      while (i < edges && edges_[i + 1] <= runs_[run].first) i += 2;
      if (i < edges && edges_[i] < runs_[run].last) values_[runs_[run].parent] = 1.0;
    }
  }
  write_values<float>(y);
}

void ConnectedComponents::spread_max(Plane y, ConstPlane a, ConstPlane mask,
                                     const KernelTable& kernels) noexcept {
  const RowReduction reduction = kernels.reduction(Reduction::kMax);  // ignores NaN
  with_cell_type(a.type, [&](auto cell) {
    using T = decltype(cell);
    label_components(mask, kernels,
                     [&](std::uint32_t row, std::uint32_t first, std::uint32_t last) -> double {
                       const T* cells = a.cells<T>(row);
                       T largest = std::numeric_limits<T>::lowest();
                       if constexpr (std::is_floating_point_v<T>) {
                         largest = -std::numeric_limits<T>::infinity();
                         constexpr std::uint32_t kLong = 32;
                         if (last - first >= kLong) {
                           reduction(cells + first, 0, 1, last - first, &largest);
                           first = last;
                         }
                       }
                       for (std::uint32_t x = first; x < last; ++x)
                         largest = cells[x] > largest ? cells[x] : largest;
                       return largest + T{0};  // 0 of -0
                     });
    write_values<T>(y);
  });
}

void ConnectedComponents::spread_sum(Plane y, ConstPlane a, ConstPlane mask,
                                     const KernelTable& kernels) noexcept {
  label_components(mask, kernels, [](std::uint32_t, std::uint32_t, std::uint32_t) { return 0.0; });
  with_cell_type(a.type, [&](auto cell) {
    using T = decltype(cell);
    using Sum = std::conditional_t<std::is_integral_v<T>, std::uint32_t, double>;  // of integers modulo 2^32
    for (std::uint32_t row = 0; row < a.height; ++row) {
      const T* cells = a.cells<T>(row);
      for (std::uint32_t run = row_starts_[row]; run < row_starts_[row + 1]; ++run) {
        double& value = values_[runs_[run].parent];
        auto sum = static_cast<Sum>(value);
        for (std::uint32_t x = runs_[run].first; x < runs_[run].last; ++x) sum += static_cast<Sum>(cells[x]);
        value = sum;
      }
    }
    write_values<T>(y);
  });
}

namespace {

// Sweeps several rows at once, east then west: the dependency chains of different rows are independent.
template <std::uint32_t kRows>
void sweep_rows(Plane y, std::uint32_t row) noexcept {
  const auto width = static_cast<std::int64_t>(y.width);
  std::int32_t nearest[kRows] = {};
  const auto step = [&](std::int64_t x) {
    for (std::uint32_t r = 0; r < kRows; ++r) {
      float& cell = y.row(row + r)[x];
      nearest[r] = std::min(nearest[r] + 1, static_cast<std::int32_t>(cell));
      cell = static_cast<float>(nearest[r]);
    }
  };
  for (std::int64_t x = 0; x < width; ++x) step(x);
  std::fill_n(nearest, kRows, 0);
  for (std::int64_t x = width - 1; x >= 0; --x) step(x);
}

}  // namespace

// City-block distance is separable: distances along the columns first, vectorised over a row, then along the
// rows.
void distance_transform(Plane y, ConstPlane a) noexcept {
  for (std::uint32_t row = 0; row < y.height; ++row) {
    float* to = y.row(row);
    const float* from = a.row(row);
    const float* above = row > 0 ? y.row(row - 1) : nullptr;
    for (std::uint32_t x = 0; x < y.width; ++x) {
      const float next = above != nullptr ? above[x] + 1.0F : 1.0F;
      to[x] = from[x] != 0.0F ? next : 0.0F;
    }
  }
  for (std::uint32_t row = y.height; row-- > 0;) {
    float* to = y.row(row);
    const float* below = row + 1 < y.height ? y.row(row + 1) : nullptr;
    for (std::uint32_t x = 0; x < y.width; ++x) {
      const float next = below != nullptr ? below[x] + 1.0F : 1.0F;
      to[x] = next < to[x] ? next : to[x];
    }
  }
  constexpr std::uint32_t kRows = 4;
  std::uint32_t row = 0;
  for (; row + kRows <= y.height; row += kRows) sweep_rows<kRows>(y, row);
  for (; row < y.height; ++row) sweep_rows<1>(y, row);
}

}  // namespace apron::vm

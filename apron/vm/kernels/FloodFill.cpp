#include "apron/vm/kernels/FloodFill.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <limits>
#include <type_traits>

namespace apron::vm {

void ConnectedComponents::reserve(std::uint32_t width, std::uint32_t height) {
  const std::size_t runs = (std::size_t{width} + 1) / 2 * height;
  if (runs > capacity_) {
    edges_ = std::make_unique_for_overwrite<std::uint32_t[]>(2 * runs);
    roots_ = std::make_unique_for_overwrite<std::uint32_t[]>(runs);
    values_ = std::make_unique_for_overwrite<std::byte[]>(sizeof(double) * runs);
    capacity_ = runs;
  }
  row_starts_.resize(std::max(row_starts_.size(), std::size_t{height} + 1));
  truths_.resize(std::max(truths_.size(), std::size_t{width} / 64 + 1));
}

std::uint32_t ConnectedComponents::find_root(std::uint32_t run) noexcept {
  while (roots_[run] != run) {
    roots_[run] = roots_[roots_[run]];
    run = roots_[run];
  }
  return run;
}

// Unites each run of the current row, [this_row, end), with the runs of the row above, [above, this_row),
// that it overlaps. The earlier of two runs is the root.
void ConnectedComponents::unite_with_row_above(std::uint32_t above, std::uint32_t this_row,
                                               std::uint32_t end) noexcept {
  for (std::uint32_t run = this_row; run < end; ++run) {
    std::uint32_t root = run;
    while (above < this_row && last_of(above) <= first_of(run)) ++above;
    for (; above < this_row && first_of(above) < last_of(run); ++above) {
      const std::uint32_t other = find_root(above);
      roots_[std::max(root, other)] = std::min(root, other);
      root = std::min(root, other);
      if (last_of(above) > last_of(run)) break;
    }
    if (root == run) roots_[run] = run;
  }
}

namespace {

// Writes the columns where runs of true cells begin and end, in turns, and returns the end of what it wrote.
std::uint32_t* find_edges(const std::uint64_t* truths, std::uint32_t width, std::uint32_t* to) noexcept {
  std::uint64_t last = 0;  // the last cell of the word before
  for (std::uint32_t x = 0; x < width; x += 64) {
    const std::uint64_t word = truths[x / 64];
    for (std::uint64_t edges = word ^ (word << 1U | last); edges != 0; edges &= edges - 1)
      *to++ = x + static_cast<std::uint32_t>(std::countr_zero(edges));
    last = word >> 63U;
  }
  if (last != 0) *to++ = width;
  return to;
}

// True if one of the bits [first, last) is 1.
bool any_bit(const std::uint64_t* bits, std::uint32_t first, std::uint32_t last) noexcept {
  std::uint64_t word = bits[first / 64] & (~std::uint64_t{0} << first % 64);
  for (std::uint32_t x = first / 64; x < (last - 1) / 64; word = bits[++x])
    if (word != 0) return true;
  return (word & (~std::uint64_t{0} >> (63 - (last - 1) % 64))) != 0;
}

}  // namespace

// Finds the runs of all rows and their roots.
void ConnectedComponents::find_components(ConstPlane mask, const KernelTable& kernels) noexcept {
  const TruthKernel find_truths = kernels.truths[index_of(mask.type)];
  std::uint32_t above = 0, end = 0;
  for (std::uint32_t row = 0; row < mask.height; ++row) {
    const std::uint32_t this_row = end;
    row_starts_[row] = this_row;
    find_truths(mask.row_bytes(row), mask.width, truths_.data());
    const std::uint32_t* edges = find_edges(truths_.data(), mask.width, &edges_[2 * std::size_t{this_row}]);
    end = static_cast<std::uint32_t>((edges - edges_.get()) / 2);
    unite_with_row_above(above, this_row, end);
    above = this_row;
  }
  row_starts_[mask.height] = end;
  for (std::uint32_t run = 0; run < end; ++run) roots_[run] = roots_[roots_[run]];  // a root is earlier
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

template <class T, class Value>
void ConnectedComponents::write_values(Plane y, const Value* values) noexcept {
  for (std::uint32_t row = 0; row < y.height; ++row) {
    T* to = y.cells<T>(row);
    std::uint32_t written = 0;
    for (std::uint32_t run = row_starts_[row]; run < row_starts_[row + 1]; ++run) {
      fill_ahead(to, written, first_of(run), y.width, T{0});
      fill_ahead(to, first_of(run), last_of(run), y.width, static_cast<T>(values[roots_[run]]));
      written = last_of(run);
    }
    fill_ahead(to, written, y.width, y.width, T{0});
  }
}

// Gives each component the value that `accumulate(value, row, first, last)` makes of `start` run by run, row
// by row.
template <class T, class Value, class Accumulate>
void ConnectedComponents::write_accumulated(Plane y, Value start, Accumulate accumulate) noexcept {
  auto* const values = reinterpret_cast<Value*>(values_.get());
  for (std::uint32_t row = 0; row < y.height; ++row)
    for (std::uint32_t run = row_starts_[row]; run < row_starts_[row + 1]; ++run) {
      Value& value = values[roots_[run]];
      value = accumulate(roots_[run] == run ? start : value, row, first_of(run), last_of(run));
    }
  write_values<T>(y, values);
}

void ConnectedComponents::flood(Plane y, ConstPlane seed, ConstPlane mask,
                                const KernelTable& kernels) noexcept {
  find_components(mask, kernels);
  const TruthKernel find_truths = kernels.truths[index_of(seed.type)];
  with_cell_type(y.type, [&](auto cell) {
    write_accumulated<decltype(cell)>(
        y, false,
        [&, from = seed.height](bool value, std::uint32_t row, std::uint32_t first,
                                std::uint32_t last) mutable {
          if (value) return true;
          if (from != row) find_truths(seed.row_bytes(row), seed.width, truths_.data());
          from = row;
          return any_bit(truths_.data(), first, last);
        });
  });
}

void ConnectedComponents::spread_max(Plane y, ConstPlane a, ConstPlane mask,
                                     const KernelTable& kernels) noexcept {
  const RowReduction reduction = kernels.reduction(Reduction::kMax);  // ignores NaN
  find_components(mask, kernels);
  with_cell_type(a.type, [&](auto cell) {
    using T = decltype(cell);
    using Limits = std::numeric_limits<T>;
    constexpr T kMin = Limits::has_infinity ? -Limits::infinity() : Limits::lowest();
    write_accumulated<T>(y, kMin, [&](T largest, std::uint32_t row, std::uint32_t first, std::uint32_t last) {
      const T* cells = a.cells<T>(row);
      constexpr std::uint32_t kLong = 32;
      if constexpr (std::is_floating_point_v<T>) {
        if (last - first >= kLong) {
          T of_run = kMin;
          reduction(cells + first, 0, 1, last - first, &of_run);
          return std::max(largest, of_run + T{0});
        }
      }
      for (std::uint32_t x = first; x < last; ++x) largest = cells[x] > largest ? cells[x] : largest;
      return static_cast<T>(largest + T{0});  // 0 of -0
    });
  });
}

void ConnectedComponents::spread_sum(Plane y, ConstPlane a, ConstPlane mask,
                                     const KernelTable& kernels) noexcept {
  find_components(mask, kernels);
  with_cell_type(a.type, [&](auto cell) {
    using T = decltype(cell);
    using Sum = std::conditional_t<std::is_integral_v<T>, std::uint32_t, double>;  // of integers modulo 2^32
    write_accumulated<T>(y, Sum{0}, [&](Sum sum, std::uint32_t row, std::uint32_t first, std::uint32_t last) {
      const T* cells = a.cells<T>(row);
      for (std::uint32_t x = first; x < last; ++x) sum += static_cast<Sum>(cells[x]);
      return sum;
    });
  });
}

void ConnectedComponents::spread_number(Plane y, ConstPlane mask, const KernelTable& kernels) noexcept {
  find_components(mask, kernels);
  write_accumulated<std::int32_t>(y, std::int32_t{0},
                                  [&](std::int32_t, std::uint32_t row, std::uint32_t, std::uint32_t last) {
                                    return static_cast<std::int32_t>(row * y.width + last);
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

#include "apron/vm/kernels/FloodFill.h"

#include <algorithm>
#include <limits>
#include <type_traits>

namespace apron::vm {

void ConnectedComponents::reserve(std::uint32_t width, std::uint32_t height) {
  runs_.reserve(std::max(runs_.capacity(), (std::size_t{width} + 1) / 2 * height));
  sums_.reserve(runs_.capacity());
  row_starts_.reserve(std::max(row_starts_.capacity(), std::size_t{height} + 1));
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
      runs_[to].value = std::max(runs_[ra].value, runs_[rb].value);
      runs_[from].parent = to;
    }
    if (runs_[a].last < runs_[b].last)
      ++a;
    else
      ++b;
  }
}

template <class Value>
void ConnectedComponents::label_components(ConstPlane mask, const Value& value) noexcept {
  runs_.clear();
  row_starts_.clear();
  std::uint32_t row_above = 0;
  for (std::uint32_t y = 0; y < mask.height; ++y) {
    const auto this_row = static_cast<std::uint32_t>(runs_.size());
    row_starts_.push_back(this_row);
    with_cell_type(mask.type, [&](auto cell) {
      const auto* row = mask.cells<decltype(cell)>(y);
      for (std::uint32_t x = 0; x < mask.width;) {
        if (!(row[x] != 0)) {
          ++x;
          continue;
        }
        const std::uint32_t first = x;
        while (x < mask.width && row[x] != 0) ++x;
        const auto self = static_cast<std::uint32_t>(runs_.size());
        runs_.push_back({first, x, self, value(y, first, x)});
      }
    });
    union_with_row_above(row_above, this_row);
    row_above = this_row;
  }
  row_starts_.push_back(static_cast<std::uint32_t>(runs_.size()));
}

template <class T, class Value>
void ConnectedComponents::write_values(Plane y, const Value& value_of_root) noexcept {
  for (std::uint32_t row = 0; row < y.height; ++row) {
    T* to = y.cells<T>(row);
    std::fill_n(to, y.width, T{0});
    for (std::uint32_t run = row_starts_[row]; run < row_starts_[row + 1]; ++run)
      std::fill(to + runs_[run].first, to + runs_[run].last, static_cast<T>(value_of_root(find_root(run))));
  }
}

void ConnectedComponents::flood(Plane y, ConstPlane seed, ConstPlane mask) noexcept {
  label_components(mask, [&](std::uint32_t row, std::uint32_t first, std::uint32_t last) {
    const float* s = seed.row(row);
    return std::any_of(s + first, s + last, [](float v) { return v != 0.0F; }) ? 1.0F : 0.0F;
  });
  write_values<float>(y, [this](std::uint32_t root) { return runs_[root].value; });
}

template <class T>
void ConnectedComponents::spread_largest_integer(Plane y, ConstPlane a, ConstPlane mask) noexcept {
  label_components(mask, [](std::uint32_t, std::uint32_t, std::uint32_t) { return 0.0F; });
  sums_.assign(runs_.size(), std::numeric_limits<T>::lowest());
  for (std::uint32_t row = 0; row < a.height; ++row)
    for (std::uint32_t run = row_starts_[row]; run < row_starts_[row + 1]; ++run) {
      double& largest = sums_[find_root(run)];
      const T* cells = a.cells<T>(row);
      largest =
          std::max<double>(largest, *std::max_element(cells + runs_[run].first, cells + runs_[run].last));
    }
  write_values<T>(y, [this](std::uint32_t root) { return static_cast<T>(sums_[root]); });
}

void ConnectedComponents::spread_max(Plane y, ConstPlane a, ConstPlane mask,
                                     const KernelTable& kernels) noexcept {
  if (program::is_integer(a.type))
    return with_cell_type(a.type, [&](auto cell) { spread_largest_integer<decltype(cell)>(y, a, mask); });
  const RowReduction largest = kernels.reduction(Reduction::kMax);  // ignores NaN
  label_components(mask, [&](std::uint32_t row, std::uint32_t first, std::uint32_t last) {
    const float* cells = a.row(row);
    constexpr std::uint32_t kShort = 32;
    float value = -std::numeric_limits<float>::infinity();
    if (last - first < kShort)
      for (std::uint32_t x = first; x < last; ++x) value = cells[x] > value ? cells[x] : value;
    else
      largest(cells + first, 0, 1, last - first, &value);
    return value + 0.0F;
  });
  write_values<float>(y, [this](std::uint32_t root) { return runs_[root].value; });
}

void ConnectedComponents::spread_sum(Plane y, ConstPlane a, ConstPlane mask) noexcept {
  label_components(mask, [](std::uint32_t, std::uint32_t, std::uint32_t) { return 0.0F; });
  sums_.assign(runs_.size(), 0.0);
  with_cell_type(a.type, [&](auto cell) {
    using T = decltype(cell);
    for (std::uint32_t row = 0; row < a.height; ++row) {
      const T* cells = a.cells<T>(row);
      for (std::uint32_t run = row_starts_[row]; run < row_starts_[row + 1]; ++run) {
        double& sum = sums_[find_root(run)];
        if constexpr (std::is_integral_v<T>) {  // modulo 2^32
          auto bits = static_cast<std::uint32_t>(sum);
          for (std::uint32_t x = runs_[run].first; x < runs_[run].last; ++x)
            bits += static_cast<std::uint32_t>(cells[x]);
          sum = bits;
        } else {
          for (std::uint32_t x = runs_[run].first; x < runs_[run].last; ++x)
            sum += static_cast<double>(cells[x]);
        }
      }
    }
    using Sum = std::conditional_t<std::is_integral_v<T>, std::uint32_t, float>;
    write_values<T>(y, [this](std::uint32_t root) { return static_cast<Sum>(sums_[root]); });
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

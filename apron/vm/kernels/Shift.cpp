#include "apron/vm/kernels/Shift.h"

#include <algorithm>
#include <cmath>
#include <type_traits>

#include "apron/vm/PlaneStore.h"

namespace apron::vm {
namespace {

using program::BoundaryRule;
using program::Opcode;

// For cells of type T.
template <class T>
struct PlaneShifter {
  static constexpr std::int64_t kVectorCells = kVectorBytes / sizeof(T);
  const KernelTable& kernels;
  Plane y;
  ConstPlane a;
  const T* mask;
  Offset offset;
  BoundaryRule rule;
  T fill;

  T* to() const { return y.cells<T>(0); }
  const T* from() const { return a.cells<T>(0); }

  std::int64_t width() const { return y.width; }
  std::int64_t height() const { return y.height; }

  void copy_block(std::int64_t row, std::int64_t rows, std::int64_t column, std::int64_t columns,
                  const T* source) const {
    const std::ptrdiff_t at = row * y.pitch + column;
    Block block(y);
    block.y = reinterpret_cast<float*>(to() + at);
    block.source[0] = reinterpret_cast<const float*>(source);
    if constexpr (std::is_same_v<T, float>)
      block.scalar[0] = fill;
    else
      block.integer[0] = fill;
    block.mask = mask != nullptr ? reinterpret_cast<const float*>(mask + at) : nullptr;
    block.rows = static_cast<std::uint32_t>(rows);
    block.columns = static_cast<std::uint32_t>(columns);
    kernels.kernel(Opcode::kCopy, source == nullptr ? 1U : 0U, mask != nullptr, y.type)(block);
  }

  // Columns [first, last) of `rows` rows, whose sources lie beyond the west or east edge.
  void fill_boundary_columns(std::int64_t row, std::int64_t rows, std::int64_t source_row, std::int64_t first,
                             std::int64_t last) const {
    for (std::int64_t x = first; x < last; ++x) {
      const std::int64_t index = resolve_boundary_index(x - offset.dx, width(), rule);
      const T* source = index == kOutside ? &fill : from() + source_row * a.pitch + index;
      const std::ptrdiff_t source_pitch = index == kOutside ? 0 : a.pitch;
      const std::ptrdiff_t at = row * y.pitch + x;
      if (mask == nullptr) {
        T* cell = to() + at;
        for (std::int64_t r = 0; r < rows; ++r, cell += y.pitch, source += source_pitch) *cell = *source;
      } else {
        for (std::ptrdiff_t i = at, end = at + rows * y.pitch; i < end; i += y.pitch, source += source_pitch)
          if (mask[i] != T{0}) to()[i] = *source;
      }
    }
  }

  // Writes rows [row, row + rows) from the rows starting at source_row. Whole vectors come first, starting at
  // an aligned column, then the boundary columns, which overwrite the excess.
  void shift_rows(std::int64_t row, std::int64_t rows, std::int64_t source_row) const {
    const std::int64_t west = std::clamp<std::int64_t>(offset.dx, 0, width());
    const std::int64_t east = std::clamp<std::int64_t>(width() + offset.dx, 0, width());
    if (west < east) {
      const std::int64_t first = west / kVectorCells * kVectorCells;
      copy_block(row, rows, first, east - first, from() + source_row * a.pitch + first - offset.dx);
    }
    fill_boundary_columns(row, rows, source_row, 0, west);
    fill_boundary_columns(row, rows, source_row, std::max(east, west), width());
  }

  void shift_boundary_row(std::int64_t row) const {
    const std::int64_t source_row = resolve_boundary_index(row - offset.dy, height(), rule);
    if (source_row == kOutside)
      copy_block(row, 1, 0, width(), nullptr);
    else
      shift_rows(row, 1, source_row);
  }

  void operator()(std::int64_t first, std::int64_t last) const {
    const std::int64_t north = std::clamp<std::int64_t>(offset.dy, first, last);
    const std::int64_t south = std::clamp<std::int64_t>(height() + offset.dy, north, last);
    for (std::int64_t row = first; row < north; ++row) shift_boundary_row(row);
    if (north < south) shift_rows(north, south - north, north - offset.dy);
    for (std::int64_t row = south; row < last; ++row) shift_boundary_row(row);
  }
};

}  // namespace

std::int64_t resolve_boundary_index(std::int64_t i, std::int64_t n, BoundaryRule rule) noexcept {
  if (i >= 0 && i < n) return i;
  switch (rule) {
    case BoundaryRule::kReplicate:
      return i < 0 ? 0 : n - 1;
    case BoundaryRule::kWrap:
      return ((i % n) + n) % n;
    case BoundaryRule::kReflect: {
      if (n == 1) return 0;
      const std::int64_t period = 2 * (n - 1);
      const std::int64_t p = ((i % period) + period) % period;
      return p < n ? p : period - p;
    }
    case BoundaryRule::kZero:
    case BoundaryRule::kValue:
      break;
  }
  return kOutside;
}

std::int64_t equivalent_distance(double distance, std::int64_t n, BoundaryRule rule) noexcept {
  const auto cells = static_cast<double>(n);
  if (rule == BoundaryRule::kWrap) return static_cast<std::int64_t>(std::fmod(distance, cells));
  if (rule == BoundaryRule::kReflect)
    return n == 1 ? 0 : static_cast<std::int64_t>(std::fmod(distance, 2.0 * (cells - 1.0)));
  return static_cast<std::int64_t>(std::clamp(distance, -cells, cells));
}

void shift(Executor& executor, Plane y, ConstPlane a, Offset offset, BoundaryCondition boundary,
           const float* mask) noexcept {
  with_cell_type(y.type, [&](auto cell) {
    using T = decltype(cell);
    const T fill = boundary.rule == BoundaryRule::kValue ? static_cast<T>(boundary.value) : T{0};
    const PlaneShifter<T> shifter{executor.kernels(), y,   a, reinterpret_cast<const T*>(mask), offset,
                                  boundary.rule,      fill};
    executor.parallel_for_rows(y.height, y.width,
                               [&](std::uint32_t first, std::uint32_t last) { shifter(first, last); });
  });
}

}  // namespace apron::vm

#include "apron/vm/kernels/Shift.h"

#include <algorithm>

#include "apron/vm/PlaneStore.h"

namespace apron::vm {
namespace {

using program::BoundaryRule;
using program::Opcode;

struct PlaneShifter {
  const KernelTable& kernels;
  Plane y;
  ConstPlane a;
  const float* mask;
  Offset offset;
  BoundaryRule rule;
  float fill;

  std::int64_t width() const { return y.width; }
  std::int64_t height() const { return y.height; }

  void copy_block(std::int64_t row, std::int64_t rows, std::int64_t column, std::int64_t columns,
                  const float* from) const {
    const std::ptrdiff_t at = row * y.pitch + column;
    Block block;
    block.y = y.data + at;
    block.source[0] = from;
    block.scalar[0] = fill;
    block.mask = mask != nullptr ? mask + at : nullptr;
    block.set_pitch(y.pitch);
    block.rows = static_cast<std::uint32_t>(rows);
    block.columns = static_cast<std::uint32_t>(columns);
    kernels.kernel(Opcode::kCopy, from == nullptr ? 1U : 0U, mask != nullptr)(block);
  }

  // Columns [first, last) of `rows` rows, whose sources lie beyond the west or east edge.
  void fill_boundary_columns(std::int64_t row, std::int64_t rows, std::int64_t source_row, std::int64_t first,
                             std::int64_t last) const {
    for (std::int64_t x = first; x < last; ++x) {
      const std::int64_t from = resolve_boundary_index(x - offset.dx, width(), rule);
      const float* source = from == kOutside ? &fill : a.data + source_row * a.pitch + from;
      const std::ptrdiff_t source_pitch = from == kOutside ? 0 : a.pitch;
      const std::ptrdiff_t at = row * y.pitch + x;
      if (mask == nullptr) {
        float* to = y.data + at;
        for (std::int64_t r = 0; r < rows; ++r, to += y.pitch, source += source_pitch) *to = *source;
      } else {
        for (std::ptrdiff_t i = at, end = at + rows * y.pitch; i < end; i += y.pitch, source += source_pitch)
          if (mask[i] != 0.0F) y.data[i] = *source;
      }
    }
  }

  // Writes rows [row, row + rows) from the rows starting at source_row. Whole vectors come first, starting at
  // an aligned column, then the boundary columns, which overwrite the excess.
  void shift_rows(std::int64_t row, std::int64_t rows, std::int64_t source_row) const {
    const std::int64_t west = std::clamp<std::int64_t>(offset.dx, 0, width());
    const std::int64_t east = std::clamp<std::int64_t>(width() + offset.dx, 0, width());
    if (west < east) {
      const std::int64_t first = west / kLanes * kLanes;
      copy_block(row, rows, first, east - first, a.data + source_row * a.pitch + first - offset.dx);
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

void shift(Executor& executor, Plane y, ConstPlane a, Offset offset, BoundaryCondition boundary,
           const float* mask) noexcept {
  const float fill = boundary.rule == BoundaryRule::kValue ? boundary.value : 0.0F;
  const PlaneShifter shifter{executor.kernels(), y, a, mask, offset, boundary.rule, fill};
  executor.parallel_for_rows(y.height, y.width,
                             [&](std::uint32_t first, std::uint32_t last) { shifter(first, last); });
}

}  // namespace apron::vm

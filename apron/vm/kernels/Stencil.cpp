#include "apron/vm/kernels/Stencil.h"

namespace apron::vm {
namespace {

using program::BoundaryRule;
using program::Opcode;

// A plane extended beyond its edges by a boundary condition.
struct BoundaryView {
  ConstPlane plane;
  BoundaryRule rule;
  float fill;

  float operator()(std::int64_t x, std::int64_t y) const noexcept {
    const std::int64_t column = resolve_boundary_index(x, plane.width, rule);
    const std::int64_t row = resolve_boundary_index(y, plane.height, rule);
    return column < 0 || row < 0 ? fill : plane.row(static_cast<std::uint32_t>(row))[column];
  }
};

BoundaryView make_boundary_view(ConstPlane a, BoundaryCondition boundary) {
  return {a, boundary.rule, boundary.rule == BoundaryRule::kValue ? boundary.value : 0.0F};
}

struct Sum {
  static float join(float a, float b) noexcept { return a + b; }
};
struct Min {
  static float join(float a, float b) noexcept { return a < b ? a : b; }
};
struct Max {
  static float join(float a, float b) noexcept { return a > b ? a : b; }
};
struct Any {
  static float join(float a, float b) noexcept { return a != 0.0F || b != 0.0F ? 1.0F : 0.0F; }
};
struct All {
  static float join(float a, float b) noexcept { return a != 0.0F && b != 0.0F ? 1.0F : 0.0F; }
};

// Reduces the neighbours of (x, y) in the order that opcodes.def specifies. cell(x, y) reads a cell: directly
// inside the array, through a BoundaryView at its edge.
template <class Op, bool kEight, class Cell>
float join(const Cell& cell, std::int64_t x, std::int64_t y) noexcept {
  const auto sides = [&](std::int64_t row) { return Op::join(cell(x - 1, row), cell(x + 1, row)); };
  if (!kEight) return Op::join(sides(y), Op::join(cell(x, y - 1), cell(x, y + 1)));
  const auto whole = [&](std::int64_t row) { return Op::join(sides(row), cell(x, row)); };
  return Op::join(sides(y), Op::join(whole(y - 1), whole(y + 1)));
}

template <class Op, bool kEight>
void reduce_neighbour_rows(const BoundaryView& extended, Plane y, const float* mask, std::int64_t first,
                           std::int64_t last) noexcept {
  const std::int64_t width = y.width, height = y.height;
  const auto inner = [&](std::int64_t column, std::int64_t row) {
    return extended.plane.data[row * extended.plane.pitch + column];
  };
  for (std::int64_t row = first; row < last; ++row) {
    float* to = y.data + row * y.pitch;
    const float* on = mask != nullptr ? mask + row * y.pitch : nullptr;
    const auto put = [&](std::int64_t column, float value) {
      if (on == nullptr || on[column] != 0.0F) to[column] = value;
    };
    const bool at_edge = row == 0 || row == height - 1 || width < 3;
    const std::int64_t inside = at_edge ? 0 : width - 2;
    if (inside > 0) {
      put(0, join<Op, kEight>(extended, 0, row));
      if (on == nullptr) {
        for (std::int64_t x = 1; x <= inside; ++x) to[x] = join<Op, kEight>(inner, x, row);
      } else {
        for (std::int64_t x = 1; x <= inside; ++x) put(x, join<Op, kEight>(inner, x, row));
      }
      put(width - 1, join<Op, kEight>(extended, width - 1, row));
    } else {
      for (std::int64_t x = 0; x < width; ++x) put(x, join<Op, kEight>(extended, x, row));
    }
  }
}

template <class Op>
void reduce_neighbours_with(Executor& executor, bool eight_connected, Plane y, const BoundaryView& extended,
                            const float* mask) noexcept {
  executor.parallel_for_rows(y.height, y.width, [&](std::uint32_t first, std::uint32_t last) {
    if (eight_connected)
      reduce_neighbour_rows<Op, true>(extended, y, mask, first, last);
    else
      reduce_neighbour_rows<Op, false>(extended, y, mask, first, last);
  });
}

template <class Cell>
float correlate_cell(const FilterView& filter, const Cell& cell, std::int64_t x, std::int64_t y) noexcept {
  float sum = 0.0F;
  const float* element = filter.coefficients;
  const std::int64_t west = x - (filter.width - 1) / 2, north = y - (filter.height - 1) / 2;
  for (std::int64_t j = 0; j < filter.height; ++j)
    for (std::int64_t i = 0; i < filter.width; ++i, ++element)
      if (*element != 0.0F) sum = sum + *element * cell(west + i, north + j);
  return sum;
}

}  // namespace

void reduce_neighbours(Executor& executor, Opcode op, bool eight_connected, Plane y, ConstPlane a,
                       BoundaryCondition boundary, const float* mask) noexcept {
  const BoundaryView extended = make_boundary_view(a, boundary);
  switch (op) {
    case Opcode::kNearSum:
      return reduce_neighbours_with<Sum>(executor, eight_connected, y, extended, mask);
    case Opcode::kNearMin:
      return reduce_neighbours_with<Min>(executor, eight_connected, y, extended, mask);
    case Opcode::kNearMax:
      return reduce_neighbours_with<Max>(executor, eight_connected, y, extended, mask);
    case Opcode::kNearAny:
      return reduce_neighbours_with<Any>(executor, eight_connected, y, extended, mask);
    default:
      return reduce_neighbours_with<All>(executor, eight_connected, y, extended, mask);
  }
}

void apply_filter(Executor& executor, const FilterView& filter, Plane y, ConstPlane a,
                  BoundaryCondition boundary, const float* mask) noexcept {
  const BoundaryView extended = make_boundary_view(a, boundary);
  const auto inner = [&](std::int64_t column, std::int64_t row) { return a.data[row * a.pitch + column]; };
  const std::int64_t west = (filter.width - 1) / 2, north = (filter.height - 1) / 2;
  const std::int64_t east = filter.width - 1 - west, south = filter.height - 1 - north;
  executor.parallel_for_rows(y.height, y.width, [&](std::uint32_t first, std::uint32_t last) {
    for (std::int64_t row = first; row < last; ++row)
      for (std::int64_t x = 0; x < y.width; ++x) {
        const std::ptrdiff_t at = row * y.pitch + x;
        if (mask != nullptr && !(mask[at] != 0.0F)) continue;
        const bool inside = x >= west && x + east < y.width && row >= north && row + south < y.height;
        y.data[at] =
            inside ? correlate_cell(filter, inner, x, row) : correlate_cell(filter, extended, x, row);
      }
  });
}

}  // namespace apron::vm

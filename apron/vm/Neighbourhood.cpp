#include "apron/vm/Neighbourhood.h"

namespace apron::vm {
namespace {

using program::BoundaryRule;
using program::Opcode;

// A plane that goes on beyond its edges.
struct Field {
  ConstPlane a;
  BoundaryRule rule;
  float fill;

  float operator()(std::int64_t x, std::int64_t y) const noexcept {
    const std::int64_t column = cell_read(x, a.width, rule);
    const std::int64_t row = cell_read(y, a.height, rule);
    return column < 0 || row < 0 ? fill : a.row(static_cast<std::uint32_t>(row))[column];
  }
};

Field field(ConstPlane a, Edge edge) {
  return {a, edge.rule, edge.rule == BoundaryRule::kValue ? edge.value : 0.0F};
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

// `cell(x, y)` gives a cell within one step; inside the array a pointer does, at its edge a Field.
template <class Op, bool kEight, class Cell>
float join(const Cell& cell, std::int64_t x, std::int64_t y) noexcept {
  const auto sides = [&](std::int64_t row) { return Op::join(cell(x - 1, row), cell(x + 1, row)); };
  if (!kEight) return Op::join(sides(y), Op::join(cell(x, y - 1), cell(x, y + 1)));
  const auto whole = [&](std::int64_t row) { return Op::join(sides(row), cell(x, row)); };
  return Op::join(sides(y), Op::join(whole(y - 1), whole(y + 1)));
}

template <class Op, bool kEight>
void near_rows(const Field& beyond, Plane y, const float* mask, std::int64_t first,
               std::int64_t last) noexcept {
  const std::int64_t width = y.width, height = y.height;
  const auto inner = [&](std::int64_t column, std::int64_t row) {
    return beyond.a.data[row * beyond.a.pitch + column];
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
      put(0, join<Op, kEight>(beyond, 0, row));
      if (on == nullptr) {
        for (std::int64_t x = 1; x <= inside; ++x) to[x] = join<Op, kEight>(inner, x, row);
      } else {
        for (std::int64_t x = 1; x <= inside; ++x) put(x, join<Op, kEight>(inner, x, row));
      }
      put(width - 1, join<Op, kEight>(beyond, width - 1, row));
    } else {
      for (std::int64_t x = 0; x < width; ++x) put(x, join<Op, kEight>(beyond, x, row));
    }
  }
}

template <class Op>
void near_as(Executor& executor, bool eight, Plane y, const Field& beyond, const float* mask) noexcept {
  executor.rows(y.height, y.width, [&](std::uint32_t first, std::uint32_t last) {
    if (eight)
      near_rows<Op, true>(beyond, y, mask, first, last);
    else
      near_rows<Op, false>(beyond, y, mask, first, last);
  });
}

template <class Cell>
float weigh(const FilterView& with, const Cell& cell, std::int64_t x, std::int64_t y) noexcept {
  float sum = 0.0F;
  const float* element = with.elements;
  const std::int64_t west = x - (with.width - 1) / 2, north = y - (with.height - 1) / 2;
  for (std::int64_t j = 0; j < with.height; ++j)
    for (std::int64_t i = 0; i < with.width; ++i, ++element)
      if (*element != 0.0F) sum = sum + *element * cell(west + i, north + j);
  return sum;
}

}  // namespace

void near(Executor& executor, Opcode op, bool eight, Plane y, ConstPlane a, Edge edge,
          const float* mask) noexcept {
  const Field beyond = field(a, edge);
  switch (op) {
    case Opcode::kNearSum:
      return near_as<Sum>(executor, eight, y, beyond, mask);
    case Opcode::kNearMin:
      return near_as<Min>(executor, eight, y, beyond, mask);
    case Opcode::kNearMax:
      return near_as<Max>(executor, eight, y, beyond, mask);
    case Opcode::kNearAny:
      return near_as<Any>(executor, eight, y, beyond, mask);
    default:
      return near_as<All>(executor, eight, y, beyond, mask);
  }
}

void filter(Executor& executor, const FilterView& with, Plane y, ConstPlane a, Edge edge,
            const float* mask) noexcept {
  const Field beyond = field(a, edge);
  const auto inner = [&](std::int64_t column, std::int64_t row) { return a.data[row * a.pitch + column]; };
  const std::int64_t west = (with.width - 1) / 2, north = (with.height - 1) / 2;
  const std::int64_t east = with.width - 1 - west, south = with.height - 1 - north;
  executor.rows(y.height, y.width, [&](std::uint32_t first, std::uint32_t last) {
    for (std::int64_t row = first; row < last; ++row)
      for (std::int64_t x = 0; x < y.width; ++x) {
        const std::ptrdiff_t at = row * y.pitch + x;
        if (mask != nullptr && !(mask[at] != 0.0F)) continue;
        const bool inside = x >= west && x + east < y.width && row >= north && row + south < y.height;
        y.data[at] = inside ? weigh(with, inner, x, row) : weigh(with, beyond, x, row);
      }
  });
}

}  // namespace apron::vm

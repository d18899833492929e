// Shifts a plane by whole cells, with any boundary condition and under a mask, without temporaries.
#pragma once

#include <cstdint>

#include "apron/program/Program.h"
#include "apron/vm/Executor.h"
#include "apron/vm/Plane.h"

namespace apron::vm {

struct BoundaryCondition {
  program::BoundaryRule rule = program::BoundaryRule::kZero;
  float value = 0.0F;  // with kValue
};

struct Offset {
  std::int64_t dx = 0, dy = 0;  // cells east, cells south
};

// The cell that index i of an axis of n cells reads under a rule, or -1 for the edge's value.
std::int64_t resolve_boundary_index(std::int64_t i, std::int64_t n, program::BoundaryRule rule) noexcept;

// y(x, row) = a(x - dx, row - dy); a cell beyond the edge reads as the rule says, columns and rows each by
// themselves: replicate: the edge's cell; wrap: the opposite side; reflect: mirrored about the edge's cell,
// which is not repeated. y is not a, same shape. mask: null, or y's pitch: writes only where it is non-zero.
void shift(Executor& executor, Plane y, ConstPlane a, Offset offset, BoundaryCondition boundary,
           const float* mask) noexcept;

}  // namespace apron::vm

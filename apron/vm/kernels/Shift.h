// Shifts a plane by whole cells, with any boundary condition and under a mask, without temporaries.
#pragma once

#include <cstdint>

#include "apron/program/BoundaryFlow.h"
#include "apron/program/Program.h"
#include "apron/vm/Plane.h"
#include "apron/vm/kernels/Executor.h"

namespace apron::vm {

using program::BoundaryCondition;

struct Offset {
  std::int64_t dx = 0, dy = 0;  // cells east, cells south
};

// The index in [0, n) that index i of an axis of n cells reads under a boundary rule, or kOutside for the
// boundary value.
inline constexpr std::int64_t kOutside = -1;
std::int64_t resolve_boundary_index(std::int64_t i, std::int64_t n, program::BoundaryRule rule) noexcept;

// A distance, limited to the axis' cells or its period, that moves the axis as the whole number `distance`
// does.
std::int64_t equivalent_distance(double distance, std::int64_t n, program::BoundaryRule rule) noexcept;

// y(x, row) = a(x - dx, row - dy). Indices beyond the edge follow the boundary rule, for columns and rows
// separately: replicate reads the edge cell, wrap the opposite side, reflect the mirror image about the edge
// cell (which is not repeated), zero and value a constant, which is one of the cells' type. y and a have the
// same shape and type and must not alias. mask is null or has y's pitch: only its non-zero cells are written.
// Does not allocate.
void shift(Executor& executor, Plane y, ConstPlane a, Offset offset, BoundaryCondition boundary,
           const float* mask) noexcept;

}  // namespace apron::vm

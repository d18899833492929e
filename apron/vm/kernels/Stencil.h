// Stencil operations: near.* and filters. opcodes.def declares their order of rounding.
#pragma once

#include <cstdint>

#include "apron/program/Program.h"
#include "apron/vm/Executor.h"
#include "apron/vm/Plane.h"
#include "apron/vm/kernels/Shift.h"

namespace apron::vm {

// op: kNearSum to kNearAll; eight: all eight neighbours, else the direct four. y is not a, same shape. mask:
// null, or y's pitch: writes only where it is non-zero. No allocation.
void reduce_neighbours(Executor& executor, program::Opcode op, bool eight_connected, Plane y, ConstPlane a,
                       BoundaryCondition boundary, const float* mask) noexcept;

// elements: width x height, row by row.
struct FilterView {
  std::uint32_t width = 0, height = 0;
  const float* coefficients = nullptr;
};

// y is not a, same shape; mask as above. No allocation.
void apply_filter(Executor& executor, const FilterView& filter, Plane y, ConstPlane a,
                  BoundaryCondition boundary, const float* mask) noexcept;

}  // namespace apron::vm

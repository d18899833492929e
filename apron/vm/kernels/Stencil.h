// Stencil operations: near.* and filters. opcodes.def declares their order of rounding.
#pragma once

#include "apron/program/Program.h"
#include "apron/vm/Plane.h"
#include "apron/vm/kernels/Executor.h"
#include "apron/vm/kernels/Shift.h"
#include "apron/vm/kernels/StencilKernels.h"

namespace apron::vm {

// Reduces the 8 or 4 neighbours of every cell of a, excluding the cell itself. op is kNearSum to kNearAll. y
// and a have the same shape and must not alias. mask is null or has y's pitch: only its non-zero cells are
// written. Does not allocate.
void reduce_neighbours(Executor& executor, program::Opcode op, bool eight_connected, Plane y, ConstPlane a,
                       BoundaryCondition boundary, const float* mask) noexcept;

// Correlates a with the filter. Preconditions as for reduce_neighbours(). Does not allocate.
void apply_filter(Executor& executor, const FilterView& filter, Plane y, ConstPlane a,
                  BoundaryCondition boundary, const float* mask) noexcept;

}  // namespace apron::vm

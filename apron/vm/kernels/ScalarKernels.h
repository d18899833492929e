// Kernels that work cell by cell (libm functions, compiled once for the baseline CPU so that every target
// gives the same bits), and the same arithmetic for scalars.
#pragma once

#include "apron/vm/kernels/Kernels.h"

namespace apron::vm {

// Sets the entries of sin to exp, pow and atan2. Inactive cells are not evaluated.
void add_scalar_kernels(KernelTable& table);

// Evaluates an element-wise opcode on scalars, bit-identical to its kernel. Ignores operands beyond the
// arity.
float evaluate_scalar(program::Opcode op, float a, float b, float c) noexcept;

}  // namespace apron::vm

// Kernels that work cell by cell (libm functions, compiled once for the baseline CPU so that every target
// gives the same bits), and the same arithmetic for scalars.
#pragma once

#include "apron/vm/kernels/Kernels.h"

namespace apron::vm {

// Sets the entries of sin to exp, pow and atan2. Inactive cells are not evaluated.
void add_scalar_kernels(KernelTable& table);

// Evaluates an element-wise opcode on scalars. The result is bit-identical to that of its kernel, except that
// whole numbers are exact (program/ScalarValue.h). Ignores operands beyond the arity.
double evaluate_scalar(program::Opcode op, double a, double b, double c) noexcept;

}  // namespace apron::vm

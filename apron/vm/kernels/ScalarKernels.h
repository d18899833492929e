// Kernels that work cell by cell (libm functions, compiled once for the baseline CPU so that every target
// gives the same bits), and the same arithmetic for scalars.
#pragma once

#include "apron/vm/kernels/Kernels.h"

namespace apron::vm {

// Sets the entries of sin … exp, pow and atan2. Inactive cells are not computed.
void add_scalar_kernels(KernelTable& table);

// What an element-wise opcode does to one cell, bit for bit; operands beyond its arity are ignored.
float evaluate_scalar(program::Opcode op, float a, float b, float c) noexcept;

}  // namespace apron::vm

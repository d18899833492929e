// Kernels that call the C library cell by cell. They are compiled once, for the baseline CPU, so that every
// target gives the same bits.
#pragma once

#include "apron/vm/kernels/KernelTable.h"

namespace apron::vm {

// Sets the entries of the APRON_LIBM instructions of program/elementwise.def. Inactive cells are not
// evaluated.
void add_scalar_kernels(KernelTable& table);

}  // namespace apron::vm

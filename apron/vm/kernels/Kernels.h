// The VM's SIMD inner loops. Each kernel is written once and compiled for every instruction set. Results are
// bit-identical on all of them (except NaN payloads): no fused multiply-add, and the mathematical functions
// are program/mathematics.def's.
#pragma once

#include <string_view>
#include <vector>

#include "apron/vm/InstructionSet.h"
#include "apron/vm/kernels/KernelTable.h"

namespace apron::vm {

// True if this CPU and this build have the instruction set, as they always have kPortable.
bool is_supported(InstructionSet isa);
// The fastest that is supported.
InstructionSet best_instruction_set();

// Null if this CPU does not support the instruction set.
const KernelTable* kernel_table(InstructionSet isa);

struct NamedKernelTable {
  std::string_view name;
  const KernelTable* table;
};
// The tables of all Highway targets that this CPU supports, best first.
const std::vector<NamedKernelTable>& kernel_tables();

}  // namespace apron::vm

// Constant folding, in the VM's 32-bit arithmetic.
#pragma once

#include <array>
#include <optional>

#include "apron/program/Program.h"

namespace apron::compiler {

// Nothing for instructions whose rounding is the machine's own (sin, pow, …).
std::optional<float> fold_constant(program::Opcode, const std::array<float, program::kMaxOperands>&);

}  // namespace apron::compiler

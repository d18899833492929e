// Constant folding, in the VM's 32-bit arithmetic.
#pragma once

#include <array>
#include <optional>

#include "apron/program/Program.h"

namespace apron::compiler {

// Returns nullopt for instructions whose rounding depends on the machine (sin, pow, …).
std::optional<float> fold_constant(program::Opcode, const std::array<float, program::kMaxOperands>&);

}  // namespace apron::compiler

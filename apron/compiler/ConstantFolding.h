// Constant folding, in the VM's arithmetic of scalars.
#pragma once

#include <array>
#include <optional>

#include "apron/program/Program.h"

namespace apron::compiler {

// Returns nullopt for instructions whose rounding depends on the machine (sin, pow, …).
std::optional<double> fold_constant(program::Opcode, const std::array<double, program::kMaxOperands>&);

}  // namespace apron::compiler

// Constant folding, in the same 32-bit arithmetic as the machine's.
#pragma once

#include <array>
#include <optional>

#include "apron/program/Program.h"

namespace apron::compiler {

// Nothing for instructions whose rounding is the machine's own (sin, pow, …).
std::optional<float> fold_constant(program::Opcode, const std::array<float, program::kMaxOperands>&);

}  // namespace apron::compiler

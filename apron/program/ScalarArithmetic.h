// The arithmetic of the controller's scalars, for the VM and for constant folding alike. Whole numbers up to
// 2^53 are exact; all other values are 32-bit floats, as the cells of registers are.
#pragma once

#include <cmath>

#include "apron/program/Program.h"

namespace apron::program {

inline constexpr double kMaxWholeScalar = 9007199254740992.0;  // 2^53

inline bool is_whole_scalar(double value) noexcept {
  return std::fabs(value) <= kMaxWholeScalar && value == std::trunc(value);
}

// The scalar that holds the result of an operation.
inline double to_scalar(double value) noexcept {
  return is_whole_scalar(value) ? value : static_cast<double>(static_cast<float>(value));
}

// Evaluates an element-wise instruction. The result has the same bits as that of its kernel on registers,
// except that whole numbers are exact. Ignores operands beyond the arity.
double evaluate_scalar(Opcode op, double a, double b, double c) noexcept;

// True for the element-wise instructions that mathematics.def defines.
bool is_mathematics(Opcode op) noexcept;

}  // namespace apron::program

#include "apron/compiler/ConstantFolding.h"

#include <cmath>

namespace apron::compiler {
namespace {

using Op = program::Opcode;

float to_float(bool value) { return value ? 1.0F : 0.0F; }

std::optional<float> fold_logical(Op op, float a, float b) {
  const bool p = a != 0.0F;
  const bool q = b != 0.0F;
  switch (op) {
    case Op::kLt:
      return to_float(a < b);
    case Op::kLe:
      return to_float(a <= b);
    case Op::kGt:
      return to_float(a > b);
    case Op::kGe:
      return to_float(a >= b);
    case Op::kEq:
      return to_float(a == b);
    case Op::kNe:
      return to_float(a != b);
    case Op::kAnd:
      return to_float(p && q);
    case Op::kOr:
      return to_float(p || q);
    case Op::kXor:
      return to_float(p != q);
    case Op::kNand:
      return to_float(!(p && q));
    case Op::kNor:
      return to_float(!(p || q));
    case Op::kNot:
      return to_float(!p);
    default:
      return std::nullopt;
  }
}

}  // namespace

std::optional<float> fold_constant(Op op, const std::array<float, program::kMaxOperands>& in) {
  const float a = in[0];
  const float b = in[1];
  switch (op) {
    case Op::kCopy:
      return a;
    case Op::kAdd:
      return a + b;
    case Op::kSub:
      return a - b;
    case Op::kMul:
      return a * b;
    case Op::kDiv:
      return a / b;
    case Op::kMod:
      return a - b * std::floor(a / b);
    case Op::kMin:
      return a < b ? a : b;
    case Op::kMax:
      return a > b ? a : b;
    case Op::kAbs:
      return std::fabs(a);
    case Op::kNeg:
      return -a;
    case Op::kSign:
      return a > 0.0F ? 1.0F : a < 0.0F ? -1.0F : 0.0F;
    case Op::kSqrt:
      return std::sqrt(a);
    case Op::kFloor:
      return std::floor(a);
    case Op::kCeil:
      return std::ceil(a);
    default:
      return fold_logical(op, a, b);
  }
}

}  // namespace apron::compiler

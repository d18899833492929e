#include "apron/compiler/Fold.h"

#include <cmath>

namespace apron::compiler {
namespace {

using Op = program::Opcode;

float truth(bool value) { return value ? 1.0F : 0.0F; }

std::optional<float> fold_logic(Op op, float a, float b) {
  const bool p = a != 0.0F;
  const bool q = b != 0.0F;
  switch (op) {
    case Op::kLt:
      return truth(a < b);
    case Op::kLe:
      return truth(a <= b);
    case Op::kGt:
      return truth(a > b);
    case Op::kGe:
      return truth(a >= b);
    case Op::kEq:
      return truth(a == b);
    case Op::kNe:
      return truth(a != b);
    case Op::kAnd:
      return truth(p && q);
    case Op::kOr:
      return truth(p || q);
    case Op::kXor:
      return truth(p != q);
    case Op::kNand:
      return truth(!(p && q));
    case Op::kNor:
      return truth(!(p || q));
    case Op::kNot:
      return truth(!p);
    default:
      return std::nullopt;
  }
}

}  // namespace

std::optional<float> fold(Op op, const std::array<float, program::kMaxSources>& in) {
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
      return fold_logic(op, a, b);
  }
}

}  // namespace apron::compiler

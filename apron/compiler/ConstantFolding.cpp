#include "apron/compiler/ConstantFolding.h"

#include <cmath>

#include "apron/program/ScalarValue.h"

namespace apron::compiler {
namespace {

using program::to_scalar;
using Op = program::Opcode;

double to_float(bool value) { return value ? 1.0 : 0.0; }

std::optional<double> fold_logical(Op op, double a, double b) {
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

std::optional<double> fold_constant(Op op, const std::array<double, program::kMaxOperands>& in) {
  const double a = in[0];
  const double b = in[1];
  switch (op) {
    case Op::kCopy:
      return a;
    case Op::kAdd:
      return to_scalar(a + b);
    case Op::kSub:
      return to_scalar(a - b);
    case Op::kMul:
      return to_scalar(a * b);
    case Op::kDiv:
      return to_scalar(a / b);
    case Op::kMod:
      return program::modulo(a, b);
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
      return to_scalar(std::sqrt(a));
    case Op::kFloor:
      return std::floor(a);
    case Op::kCeil:
      return std::ceil(a);
    default:
      return fold_logical(op, a, b);
  }
}

}  // namespace apron::compiler

#include "apron/vm/kernels/ScalarKernels.h"

#include <cassert>
#include <cmath>

#include "apron/program/ScalarValue.h"

namespace apron::vm {
namespace {

using program::Opcode;
using program::to_scalar;

// max(lo, min(hi, a)), with the kernels' order of comparison.
double clamp_scalar(double a, double lo, double hi) {
  const double upper = hi < a ? hi : a;
  return lo > upper ? lo : upper;
}

// Wrappers that serve as template arguments: the overloads of the standard functions vary by library.
float f_sin(float a) { return std::sin(a); }
float f_cos(float a) { return std::cos(a); }
float f_tan(float a) { return std::tan(a); }
float f_sinh(float a) { return std::sinh(a); }
float f_cosh(float a) { return std::cosh(a); }
float f_tanh(float a) { return std::tanh(a); }
float f_asin(float a) { return std::asin(a); }
float f_acos(float a) { return std::acos(a); }
float f_atan(float a) { return std::atan(a); }
float f_ln(float a) { return std::log(a); }
float f_log(float a) { return std::log10(a); }
float f_exp(float a) { return std::exp(a); }
float f_pow(float a, float b) { return std::pow(a, b); }
float f_atan2(float a, float b) { return std::atan2(a, b); }

template <bool kMasked, class Cell>
void for_each_cell(const Block& block, Cell&& cell) {
  for (std::ptrdiff_t r = 0; r < block.rows; ++r) {
    float* y = block.y + r * block.pitch;
    const float* mask = block.mask + (kMasked ? r * block.mask_pitch : 0);
    for (std::ptrdiff_t x = 0; x < block.columns; ++x)
      if (!kMasked || mask[x] != 0.0F) y[x] = cell(r, x);
  }
}

float operand(const Block& block, std::size_t k, std::ptrdiff_t r, std::ptrdiff_t x) {
  return block.source[k] != nullptr ? block.source[k][r * block.source_pitch[k] + x] : block.scalar[k];
}

template <float (*kFunction)(float), bool kMasked>
void apply_unary(const Block& block) noexcept {
  for_each_cell<kMasked>(
      block, [&](std::ptrdiff_t r, std::ptrdiff_t x) { return kFunction(operand(block, 0, r, x)); });
}

template <float (*kFunction)(float, float), bool kMasked>
void apply_binary(const Block& block) noexcept {
  for_each_cell<kMasked>(block, [&](std::ptrdiff_t r, std::ptrdiff_t x) {
    return kFunction(operand(block, 0, r, x), operand(block, 1, r, x));
  });
}

template <float (*kFunction)(float)>
void add_kernels(KernelTable& table, Opcode op) {
  for (unsigned scalars = 0; scalars < 2; ++scalars)
    table.elementwise[static_cast<std::size_t>(op)][scalars] = {apply_unary<kFunction, false>,
                                                                apply_unary<kFunction, true>};
}

template <float (*kFunction)(float, float)>
void add_kernels(KernelTable& table, Opcode op) {
  for (unsigned scalars = 0; scalars < 4; ++scalars)
    table.elementwise[static_cast<std::size_t>(op)][scalars] = {apply_binary<kFunction, false>,
                                                                apply_binary<kFunction, true>};
}

float to_float(bool truth) { return truth ? 1.0F : 0.0F; }
bool is_true(float a) { return a != 0.0F; }

}  // namespace

void add_scalar_kernels(KernelTable& table) {
  add_kernels<f_sin>(table, Opcode::kSin);
  add_kernels<f_cos>(table, Opcode::kCos);
  add_kernels<f_tan>(table, Opcode::kTan);
  add_kernels<f_sinh>(table, Opcode::kSinh);
  add_kernels<f_cosh>(table, Opcode::kCosh);
  add_kernels<f_tanh>(table, Opcode::kTanh);
  add_kernels<f_asin>(table, Opcode::kAsin);
  add_kernels<f_acos>(table, Opcode::kAcos);
  add_kernels<f_atan>(table, Opcode::kAtan);
  add_kernels<f_ln>(table, Opcode::kLn);
  add_kernels<f_log>(table, Opcode::kLog);
  add_kernels<f_exp>(table, Opcode::kExp);
  add_kernels<f_pow>(table, Opcode::kPow);
  add_kernels<f_atan2>(table, Opcode::kAtan2);
}

double evaluate_scalar(Opcode op, double wide_a, double wide_b, double wide_c) noexcept {
  const auto a = static_cast<float>(wide_a), b = static_cast<float>(wide_b);
  switch (op) {
    case Opcode::kCopy:
      return wide_a;
    case Opcode::kAdd:
      return to_scalar(wide_a + wide_b);
    case Opcode::kSub:
      return to_scalar(wide_a - wide_b);
    case Opcode::kMul:
      return to_scalar(wide_a * wide_b);
    case Opcode::kDiv:
      return to_scalar(wide_a / wide_b);
    case Opcode::kMod:
      return program::modulo(wide_a, wide_b);
    case Opcode::kMin:
      return wide_a < wide_b ? wide_a : wide_b;
    case Opcode::kMax:
      return wide_a > wide_b ? wide_a : wide_b;
    case Opcode::kPow:
      return f_pow(a, b);
    case Opcode::kAtan2:
      return f_atan2(a, b);
    case Opcode::kAbs:
      return std::fabs(wide_a);
    case Opcode::kNeg:
      return -wide_a;
    case Opcode::kSign:
      return to_float(a > 0.0F) - to_float(a < 0.0F);
    case Opcode::kClamp:
      return clamp_scalar(wide_a, wide_b, wide_c);
    case Opcode::kMac:
      return to_scalar(wide_c + to_scalar(wide_a * wide_b));
    case Opcode::kSelect:
      return is_true(a) ? wide_b : wide_c;
    case Opcode::kLt:
      return to_float(wide_a < wide_b);
    case Opcode::kLe:
      return to_float(wide_a <= wide_b);
    case Opcode::kGt:
      return to_float(wide_a > wide_b);
    case Opcode::kGe:
      return to_float(wide_a >= wide_b);
    case Opcode::kEq:
      return to_float(wide_a == wide_b);
    case Opcode::kNe:
      return to_float(wide_a != wide_b);
    case Opcode::kAnd:
      return to_float(is_true(a) && is_true(b));
    case Opcode::kOr:
      return to_float(is_true(a) || is_true(b));
    case Opcode::kXor:
      return to_float(is_true(a) != is_true(b));
    case Opcode::kNand:
      return to_float(!(is_true(a) && is_true(b)));
    case Opcode::kNor:
      return to_float(!(is_true(a) || is_true(b)));
    case Opcode::kNot:
      return to_float(!is_true(a));
    case Opcode::kSin:
      return f_sin(a);
    case Opcode::kCos:
      return f_cos(a);
    case Opcode::kTan:
      return f_tan(a);
    case Opcode::kSinh:
      return f_sinh(a);
    case Opcode::kCosh:
      return f_cosh(a);
    case Opcode::kTanh:
      return f_tanh(a);
    case Opcode::kAsin:
      return f_asin(a);
    case Opcode::kAcos:
      return f_acos(a);
    case Opcode::kAtan:
      return f_atan(a);
    case Opcode::kLn:
      return f_ln(a);
    case Opcode::kLog:
      return f_log(a);
    case Opcode::kExp:
      return f_exp(a);
    case Opcode::kSqrt:
      return std::sqrt(a);
    case Opcode::kFloor:
      return std::floor(wide_a);
    case Opcode::kCeil:
      return std::ceil(wide_a);
    case Opcode::kRound:
      return std::round(wide_a);
    default:
      assert(false && "not an element-wise opcode");
      return 0.0F;
  }
}

}  // namespace apron::vm

#include "apron/program/ScalarArithmetic.h"

#include <cassert>

#include "apron/program/Mathematics.h"

namespace apron::program {
namespace {

double zero() { return 0.0; }
double add(double a, double b) { return to_scalar(a + b); }
double subtract(double a, double b) { return to_scalar(a - b); }
double multiply(double a, double b) { return to_scalar(a * b); }
double divide(double a, double b) { return to_scalar(a / b); }
// The result of whole numbers is exact, although their quotient may be no scalar.
double modulo(double a, double b) {
  if (is_whole_scalar(a) && is_whole_scalar(b)) return to_scalar(a - b * std::floor(a / b));
  const float x = static_cast<float>(a), y = static_cast<float>(b);
  return x - y * std::floor(x / y);
}
double smaller(double a, double b) { return a < b ? a : b; }
double larger(double a, double b) { return a > b ? a : b; }
double magnitude(double a) { return std::fabs(a); }
double negate(double a) { return -a; }
double square_root(double a) { return std::sqrt(static_cast<float>(a)); }
double floor_of(double a) { return std::floor(a); }
double ceil_of(double a) { return std::ceil(a); }
double round_half_away(double a) { return std::round(a); }
double choose(bool condition, double a, double b) { return condition ? a : b; }
double as_number(bool truth) { return truth ? 1.0 : 0.0; }
double as_inverse_number(bool truth) { return truth ? 0.0 : 1.0; }
bool is_true(double a) { return a != 0.0; }
bool less(double a, double b) { return a < b; }
bool less_equal(double a, double b) { return a <= b; }
bool equal(double a, double b) { return a == b; }
bool differ(double a, double b) { return a != b; }
bool both(bool a, bool b) { return a && b; }
bool either(bool a, bool b) { return a || b; }
bool one_of(bool a, bool b) { return a != b; }

}  // namespace

double evaluate_scalar(Opcode op, double a, double b, double c) noexcept {
  if (is_mathematics(op)) return evaluate_mathematics(op, static_cast<float>(a), static_cast<float>(b));
  switch (op) {
#define APRON_ELEMENTWISE(name, arity, value) \
  case Opcode::k##name:                       \
    return value;
#include "apron/program/elementwise.def"
    default:
      assert(false && "not an element-wise opcode");
      return 0.0;
  }
}

bool is_mathematics(Opcode op) noexcept {
  switch (op) {
#define APRON_MATHEMATICS(name, arity, value) case Opcode::k##name:
#include "apron/program/elementwise.def"
    return true;
    default:
      return false;
  }
}

}  // namespace apron::program

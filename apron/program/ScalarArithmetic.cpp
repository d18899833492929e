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
// Bits are those of 64-bit integers; a number that is none has those of its whole part, or none.
std::int64_t whole(double a) { return std::fabs(a) <= kMaxWholeScalar ? static_cast<std::int64_t>(a) : 0; }
double from_whole(std::int64_t a) { return to_scalar(static_cast<double>(a)); }
double bit_and(double a, double b) { return from_whole(whole(a) & whole(b)); }
double bit_or(double a, double b) { return from_whole(whole(a) | whole(b)); }
double bit_xor(double a, double b) { return from_whole(whole(a) ^ whole(b)); }
double bit_not(double a) { return from_whole(~whole(a)); }
double bit_left(double a, double b) {
  const bool within = b >= 0.0 && b < 64.0;
  const auto bits = static_cast<std::uint64_t>(whole(a));
  return within ? from_whole(static_cast<std::int64_t>(bits << static_cast<unsigned>(b))) : 0.0;
}
double bit_right(double a, double b) {
  return from_whole(whole(a) >> static_cast<unsigned>(b >= 0.0 && b < 63.0 ? b : 63.0));
}

}  // namespace

double evaluate_scalar(Opcode op, double a, double b, double c) noexcept {
  if (is_mathematics(op)) return evaluate_mathematics(op, static_cast<float>(a), static_cast<float>(b));
  switch (op) {
#define APRON_ELEMENTWISE(name, arity, value) \
  case Opcode::k##name:                       \
    return value;
#define APRON_INTEGER(name, arity, value) \
  case Opcode::k##name:                   \
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

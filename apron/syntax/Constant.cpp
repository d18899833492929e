#include "apron/syntax/Constant.h"

#include <fmt/format.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>

namespace apron::syntax {
namespace {

constexpr int kMaxDepth = 64;

struct EvaluationError {
  Location location;
  std::string message;
};

// As program::to_scalar(): whole numbers up to 2^53 are exact, all others 32-bit floats.
constexpr double kMaxWhole = 9007199254740992.0;

bool is_whole(double value) { return std::fabs(value) <= kMaxWhole && value == std::trunc(value); }
double to_scalar(double value) {
  return is_whole(value) ? value : static_cast<double>(static_cast<float>(value));
}
// The bits of a 64-bit integer; of a number that is none, no bits.
std::int64_t bits_of(double value) { return is_whole(value) ? static_cast<std::int64_t>(value) : 0; }

double modulo(double a, double b) {
  if (is_whole(a) && is_whole(b)) return a - b * std::floor(a / b);
  const auto x = static_cast<float>(a), y = static_cast<float>(b);
  return x - y * std::floor(x / y);
}

double shifted(std::int64_t bits, std::string_view op, double by) {
  if (op == "<<" && (by < 0.0 || by >= 64.0)) return 0.0;
  if (op == "<<")
    return static_cast<double>(
        static_cast<std::int64_t>(static_cast<std::uint64_t>(bits) << static_cast<unsigned>(by)));
  return static_cast<double>(bits >> static_cast<unsigned>(by >= 0.0 && by < 63.0 ? by : 63.0));
}

bool is_logical(std::string_view op) {
  return op == "and" || op == "or" || op == "xor" || op == "nand" || op == "nor" || op == "&&" || op == "||";
}
bool truth_of(std::string_view op, bool a, bool b) {
  if (op == "xor") return a != b;
  if (op == "or" || op == "||") return a || b;
  if (op == "nor") return !(a || b);
  return (a && b) != (op == "nand");
}

bool takes_bits(std::string_view op) {
  return op == "&" || op == "|" || op == "^" || op == "<<" || op == ">>" || op == "~";
}

class ConstantEvaluator {
 public:
  ConstantEvaluator(const Tokens& tokens, Location location) : tokens_(tokens), end_location_(location) {}

  Constant evaluate() {
    Constant value = parse_binary(1);
    if (position_ < tokens_.size())
      fail(fmt::format("unexpected '{}' in a constant", spelling(tokens_[position_])));
    return value;
  }

  bool evaluate_condition() {
    const Location begin = current_location();
    return is_true(evaluate(), begin);
  }

 private:
  Location current_location() const {
    return position_ < tokens_.size() ? tokens_[position_].location : end_location_;
  }

  [[noreturn]] void fail(std::string text) const {
    throw EvaluationError{current_location(), std::move(text)};
  }

  static bool is_true(const Constant& value, Location location) {
    if (!value.is_string) return value.number != 0.0;
    throw EvaluationError{location, fmt::format("'{0}' is no number, true or false: !define({0}, 1) makes it "
                                                "one, and == compares it",
                                                display_name(value.text))};
  }

  bool consume(std::string_view symbol) {
    if (position_ >= tokens_.size() || !tokens_[position_].is(symbol)) return false;
    ++position_;
    return true;
  }

  static Constant from_number(double number) { return {false, {}, number}; }

  struct Operand {
    Constant value;
    Location location;
  };

  static double number_of(const Constant& value, const Token& op) {
    if (value.is_string)
      throw EvaluationError{op.location,
                            fmt::format("'{}' is not a constant number", display_name(value.text))};
    if (takes_bits(op.text) && value.number != std::floor(value.number))
      throw EvaluationError{op.location, fmt::format("'{}' takes whole numbers, and {} has a fraction{}",
                                                     op.text, static_cast<float>(value.number),
                                                     op.is("^") ? "; a power is pow(a, b)" : "")};
    return value.number;
  }

  static Constant apply(const Token& op, const Operand& left, const Operand& right) {
    if (infix_precedence(op) == kComparisonPrecedence) {
      const std::optional<bool> result = compare(left.value, op.text, right.value);
      if (!result) throw EvaluationError{op.location, "texts and names compare by == and != only"};
      return from_number(*result ? 1.0 : 0.0);
    }
    if (is_logical(op.text)) {
      const bool is_left = is_true(left.value, left.location),
                 is_right = is_true(right.value, right.location);
      return from_number(truth_of(op.text, is_left, is_right) ? 1.0 : 0.0);
    }
    const double a = number_of(left.value, op), b = number_of(right.value, op);
    switch (op.text.front()) {
      case '+':
        return from_number(to_scalar(a + b));
      case '-':
        return from_number(to_scalar(a - b));
      case '*':
        return from_number(to_scalar(a * b));
      case '/':
        return from_number(to_scalar(a / b));
      case '%':
        return from_number(to_scalar(modulo(a, b)));
      case '&':
        return from_number(to_scalar(static_cast<double>(bits_of(a) & bits_of(b))));
      case '|':
        return from_number(to_scalar(static_cast<double>(bits_of(a) | bits_of(b))));
      case '^':
        return from_number(to_scalar(static_cast<double>(bits_of(a) ^ bits_of(b))));
      default:
        return from_number(to_scalar(shifted(bits_of(a), op.text, b)));
    }
  }

  int next_precedence() const {
    return position_ < tokens_.size() ? infix_precedence(tokens_[position_]) : 0;
  }

  Constant parse_binary(int level) {
    const Location begin = current_location();
    Constant left = parse_not(level);
    for (bool is_comparison = false; next_precedence() >= level;) {
      const Token& op = tokens_[position_];
      const int precedence = infix_precedence(op);
      if (std::exchange(is_comparison, precedence == kComparisonPrecedence) && is_comparison)
        fail("comparisons do not chain; join them with 'and'");
      ++position_;
      const Location middle = current_location();
      const Constant right = parse_binary(precedence + 1);
      left = apply(op, {left, begin}, {right, middle});
    }
    return left;
  }

  // `not` as in expressions: above `and` and below comparisons. Before a bracket and behind an operator that
  // binds tighter, it takes one operand, and what follows has two readings.
  Constant parse_not(int level) {
    const bool is_not = position_ + 1 < tokens_.size() && tokens_[position_].is_name("not");
    const auto begins_operand = [](const Token& token) {
      return infix_precedence(token) == 0 || token.is("-") || token.is("+");
    };
    if (!is_not || !begins_operand(tokens_[position_ + 1])) return parse_unary();
    if (++depth_ > kMaxDepth) fail("this constant is nested too deeply");
    const Location begin = tokens_[++position_].location;
    const bool has_bracket = tokens_[position_].is("("), is_loose = level <= kNotPrecedence && !has_bracket;
    const Constant value = is_loose      ? parse_binary(kNotPrecedence)
                           : has_bracket ? parse_unary()
                                         : parse_not(level);
    if (!is_loose && next_precedence() > kNotPrecedence)
      fail(fmt::format("'not {} {}' has two readings: put one in parentheses", has_bracket ? "(…)" : "…",
                       tokens_[position_].text));
    --depth_;
    return from_number(is_true(value, begin) ? 0.0 : 1.0);
  }

  Constant parse_unary() {
    if (++depth_ > kMaxDepth) fail("this constant is nested too deeply");
    const Token* const op = position_ < tokens_.size() ? &tokens_[position_] : nullptr;
    Constant value;
    if (consume("-")) {
      value = from_number(-number_of(parse_not(kTightest), *op));
    } else if (consume("~")) {
      value = from_number(to_scalar(static_cast<double>(~bits_of(number_of(parse_not(kTightest), *op)))));
    } else if (consume("+")) {
      value = parse_not(kTightest);
    } else if (consume("!")) {
      const Location begin = current_location();
      value = from_number(is_true(parse_not(kTightest), begin) ? 0.0 : 1.0);
    } else {
      value = parse_primary();
    }
    --depth_;
    return value;
  }

  Constant parse_primary() {
    if (consume("(")) {
      Constant value = parse_binary(1);
      if (!consume(")")) fail("expected ')'");
      return value;
    }
    if (position_ >= tokens_.size()) fail("expected a constant");
    const Token& token = tokens_[position_];
    const bool is_text = token.kind == TokenKind::kString || token.kind == TokenKind::kName;
    if (!is_text && token.kind != TokenKind::kNumber)
      fail(fmt::format("expected a constant, not '{}'", spelling(token)));
    ++position_;
    if (token.kind == TokenKind::kName && position_ < tokens_.size() && tokens_[position_].is("(")) {
      throw EvaluationError{token.location,
                            fmt::format("'{}' is an instruction; a directive takes numbers, texts, names and "
                                        "operators",
                                        display_name(token.text))};
    }
    return is_text ? Constant{true, token.text, 0} : from_number(token.number);
  }

  const Tokens& tokens_;
  Location end_location_;
  std::size_t position_ = 0;
  int depth_ = 0;
};

// The function's value, or nothing and its error among the diagnostics.
template <class Function>
auto reported(Diagnostics& diagnostics, const Function& function) -> std::optional<decltype(function())> {
  try {
    return function();
  } catch (const EvaluationError& failure) {
    diagnostics.error(failure.location, failure.message);
    return std::nullopt;
  }
}

}  // namespace

std::optional<bool> compare(const Constant& a, std::string_view op, const Constant& b) {
  if (a.is_string || b.is_string) {
    const bool equal = a.is_string == b.is_string && a.text == b.text;
    if (op == "==") return equal;
    if (op == "!=") return !equal;
    return std::nullopt;
  }
  if (op == "<") return a.number < b.number;
  if (op == "<=") return a.number <= b.number;
  if (op == ">") return a.number > b.number;
  if (op == ">=") return a.number >= b.number;
  if (op == "==") return a.number == b.number;
  if (op == "!=") return a.number != b.number;
  return std::nullopt;
}

std::optional<Constant> evaluate_constant(const Tokens& tokens, Location location, Diagnostics& diagnostics) {
  return reported(diagnostics, [&] { return ConstantEvaluator(tokens, location).evaluate(); });
}

std::optional<bool> evaluate_condition(const Tokens& tokens, Location location, Diagnostics& diagnostics) {
  return reported(diagnostics, [&] { return ConstantEvaluator(tokens, location).evaluate_condition(); });
}

}  // namespace apron::syntax

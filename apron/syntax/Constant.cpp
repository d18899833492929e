#include "apron/syntax/Constant.h"

#include <fmt/format.h>

#include <cmath>
#include <cstddef>
#include <utility>

namespace apron::syntax {
namespace {

constexpr int kMaxDepth = 64;
constexpr int kLowest = 1, kComparison = 3;  // precedences

struct EvaluationError {
  Location location;
  std::string message;
};

int precedence(const Token& token) {
  if (token.kind == TokenKind::kName) return token.text == "or" ? 1 : token.text == "and" ? 2 : 0;
  if (token.kind != TokenKind::kPunctuator) return 0;
  static constexpr std::pair<std::string_view, int> kOperators[] = {
      {"||", 1}, {"&&", 2}, {"<", 3}, {"<=", 3}, {">", 3}, {">=", 3}, {"==", 3},
      {"!=", 3}, {"+", 4},  {"-", 4}, {"*", 5},  {"/", 5}, {"%", 5}};
  for (const auto& [text, level] : kOperators) {
    if (token.text == text) return level;
  }
  return 0;
}

class ConstantEvaluator {
 public:
  ConstantEvaluator(const Tokens& tokens, Location location) : tokens_(tokens), end_location_(location) {}

  Constant evaluate() {
    Constant value = parse_binary(kLowest);
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

  Constant apply(const Token& op, const Operand& left, const Operand& right) const {
    const Constant &a = left.value, &b = right.value;
    const int level = precedence(op);
    if (level == kComparison) {
      const std::optional<bool> result = compare(a, op.text, b);
      if (!result) throw EvaluationError{op.location, "texts and names compare by == and != only"};
      return from_number(*result ? 1.0 : 0.0);
    }
    if (level < kComparison) {
      const bool is_left = is_true(a, left.location), is_right = is_true(b, right.location);
      return from_number((level == kLowest ? is_left || is_right : is_left && is_right) ? 1.0 : 0.0);
    }
    if (a.is_string || b.is_string) {
      throw EvaluationError{op.location, fmt::format("'{}' is not a constant number",
                                                     display_name(a.is_string ? a.text : b.text))};
    }
    switch (op.text.front()) {
      case '+':
        return from_number(a.number + b.number);
      case '-':
        return from_number(a.number - b.number);
      case '*':
        return from_number(a.number * b.number);
      case '/':
        return from_number(a.number / b.number);
      default:
        return from_number(a.number - b.number * std::floor(a.number / b.number));
    }
  }

  Constant parse_binary(int level) {
    const Location begin = current_location();
    Constant left = parse_operand(level);
    for (bool is_comparison = false; position_ < tokens_.size();) {
      const Token& op = tokens_[position_];
      if (precedence(op) < level) break;
      if (std::exchange(is_comparison, precedence(op) == kComparison) && is_comparison)
        fail("comparisons do not chain; join them with 'and'");
      ++position_;
      const Location middle = current_location();
      const Constant right = parse_binary(precedence(op) + 1);
      left = apply(op, {left, begin}, {right, middle});
    }
    return left;
  }

  // `not` is above `and` and below comparisons, as in expressions.
  Constant parse_operand(int level) {
    const bool is_not =
        level <= kComparison && position_ + 1 < tokens_.size() && tokens_[position_].is_name("not");
    const auto begins_operand = [](const Token& token) {
      return precedence(token) == 0 || token.is("-") || token.is("+");
    };
    if (!is_not || !begins_operand(tokens_[position_ + 1])) return parse_unary();
    if (++depth_ > kMaxDepth) fail("this constant is nested too deeply");
    const Location begin = tokens_[++position_].location;
    const bool has_parenthesis = tokens_[position_].is("(");
    const Constant value = has_parenthesis ? parse_unary() : parse_binary(kComparison);
    if (has_parenthesis && position_ < tokens_.size() && precedence(tokens_[position_]) >= kComparison)
      fail(fmt::format("'not (…) {}' has two readings: put one in parentheses", tokens_[position_].text));
    --depth_;
    return from_number(is_true(value, begin) ? 0.0 : 1.0);
  }

  Constant parse_unary() {
    if (++depth_ > kMaxDepth) fail("this constant is nested too deeply");
    Constant value;
    if (consume("-")) {
      value = parse_unary();
      if (value.is_string) fail(fmt::format("'{}' is not a constant number", display_name(value.text)));
      value.number = -value.number;
    } else if (consume("+")) {
      value = parse_unary();
    } else if (consume("!")) {
      const Location begin = current_location();
      value = from_number(is_true(parse_unary(), begin) ? 0.0 : 1.0);
    } else {
      value = parse_primary();
    }
    --depth_;
    return value;
  }

  Constant parse_primary() {
    if (consume("(")) {
      Constant value = parse_binary(kLowest);
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

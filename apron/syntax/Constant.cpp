#include "apron/syntax/Constant.h"

#include <fmt/format.h>

#include <cmath>
#include <cstddef>
#include <utility>

namespace apron::syntax {
namespace {

constexpr int kMaxDepth = 64;

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
    Constant value = parse_binary(1);
    if (position_ < tokens_.size())
      fail(fmt::format("unexpected '{}' in a constant", spelling(tokens_[position_])));
    return value;
  }

 private:
  [[noreturn]] void fail(std::string text) const {
    throw EvaluationError{position_ < tokens_.size() ? tokens_[position_].location : end_location_,
                          std::move(text)};
  }

  bool consume(std::string_view symbol) {
    if (position_ >= tokens_.size() || !tokens_[position_].is(symbol)) return false;
    ++position_;
    return true;
  }

  static Constant from_number(double number) { return {false, {}, number}; }

  Constant apply(const Token& op, const Constant& a, const Constant& b) const {
    if (precedence(op) == 3) {
      const std::optional<bool> result = compare(a, op.text, b);
      if (!result) throw EvaluationError{op.location, "texts and names compare by == and != only"};
      return from_number(*result ? 1.0 : 0.0);
    }
    if (precedence(op) == 1) return from_number(a.is_true() || b.is_true() ? 1.0 : 0.0);
    if (precedence(op) == 2) return from_number(a.is_true() && b.is_true() ? 1.0 : 0.0);
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
    Constant left = parse_unary();
    while (position_ < tokens_.size() && precedence(tokens_[position_]) >= level) {
      const Token op = tokens_[position_++];
      const Constant right = parse_binary(precedence(op) + 1);
      left = apply(op, left, right);
    }
    return left;
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
      value = from_number(parse_unary().is_true() ? 0.0 : 1.0);
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
    return is_text ? Constant{true, token.text, 0} : from_number(token.number);
  }

  const Tokens& tokens_;
  Location end_location_;
  std::size_t position_ = 0;
  int depth_ = 0;
};

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
  try {
    return ConstantEvaluator(tokens, location).evaluate();
  } catch (const EvaluationError& failure) {
    diagnostics.error(failure.location, failure.message);
    return std::nullopt;
  }
}

}  // namespace apron::syntax

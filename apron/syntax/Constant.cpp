#include "apron/syntax/Constant.h"

#include <fmt/format.h>

#include <cmath>
#include <cstddef>
#include <utility>

namespace apron::syntax {
namespace {

constexpr int kMaxDepth = 64;

struct Failure {
  Location at;
  std::string text;
};

int precedence(const Token& token) {
  if (token.kind == TokenKind::kName) return token.text == "or" ? 1 : token.text == "and" ? 2 : 0;
  if (token.kind != TokenKind::kSymbol) return 0;
  static constexpr std::pair<std::string_view, int> kOperators[] = {
      {"||", 1}, {"&&", 2}, {"<", 3}, {"<=", 3}, {">", 3}, {">=", 3}, {"==", 3},
      {"!=", 3}, {"+", 4},  {"-", 4}, {"*", 5},  {"/", 5}, {"%", 5}};
  for (const auto& [text, level] : kOperators) {
    if (token.text == text) return level;
  }
  return 0;
}

class Evaluator {
 public:
  Evaluator(const Tokens& tokens, Location at) : tokens_(tokens), end_at_(at) {}

  Constant run() {
    Constant value = binary(1);
    if (at_ < tokens_.size()) fail(fmt::format("unexpected '{}' in a constant", spell(tokens_[at_])));
    return value;
  }

 private:
  [[noreturn]] void fail(std::string text) const {
    throw Failure{at_ < tokens_.size() ? tokens_[at_].at : end_at_, std::move(text)};
  }

  bool take(std::string_view symbol) {
    if (at_ >= tokens_.size() || !tokens_[at_].is(symbol)) return false;
    ++at_;
    return true;
  }

  static Constant of(double number) { return {false, {}, number}; }

  Constant apply(const Token& op, const Constant& a, const Constant& b) const {
    if (precedence(op) == 3) {
      const std::optional<bool> holds = compare(a, op.text, b);
      if (!holds) throw Failure{op.at, "texts and names compare by == and != only"};
      return of(*holds ? 1.0 : 0.0);
    }
    if (precedence(op) == 1) return of(a.truth() || b.truth() ? 1.0 : 0.0);
    if (precedence(op) == 2) return of(a.truth() && b.truth() ? 1.0 : 0.0);
    if (a.is_text || b.is_text) {
      throw Failure{op.at,
                    fmt::format("'{}' is not a constant number", written(a.is_text ? a.text : b.text))};
    }
    switch (op.text.front()) {
      case '+':
        return of(a.number + b.number);
      case '-':
        return of(a.number - b.number);
      case '*':
        return of(a.number * b.number);
      case '/':
        return of(a.number / b.number);
      default:
        return of(a.number - b.number * std::floor(a.number / b.number));
    }
  }

  Constant binary(int level) {
    Constant left = unary();
    while (at_ < tokens_.size() && precedence(tokens_[at_]) >= level) {
      const Token op = tokens_[at_++];
      const Constant right = binary(precedence(op) + 1);
      left = apply(op, left, right);
    }
    return left;
  }

  Constant unary() {
    if (++depth_ > kMaxDepth) fail("this constant is nested too deeply");
    Constant value;
    if (take("-")) {
      value = unary();
      if (value.is_text) fail(fmt::format("'{}' is not a constant number", written(value.text)));
      value.number = -value.number;
    } else if (take("+")) {
      value = unary();
    } else if (take("!")) {
      value = of(unary().truth() ? 0.0 : 1.0);
    } else {
      value = primary();
    }
    --depth_;
    return value;
  }

  Constant primary() {
    if (take("(")) {
      Constant value = binary(1);
      if (!take(")")) fail("expected ')'");
      return value;
    }
    if (at_ >= tokens_.size()) fail("expected a constant");
    const Token& token = tokens_[at_];
    if (token.kind == TokenKind::kNumber) return ++at_, of(token.number);
    if (token.kind == TokenKind::kText || token.kind == TokenKind::kName)
      return ++at_, Constant{true, token.text, 0};
    fail(fmt::format("expected a constant, not '{}'", spell(token)));
  }

  const Tokens& tokens_;
  Location end_at_;
  std::size_t at_ = 0;
  int depth_ = 0;
};

}  // namespace

std::optional<bool> compare(const Constant& a, std::string_view op, const Constant& b) {
  if (a.is_text || b.is_text) {
    const bool equal = a.is_text == b.is_text && a.text == b.text;
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

std::optional<Constant> evaluate(const Tokens& tokens, Location at, Diagnostics& diagnostics) {
  try {
    return Evaluator(tokens, at).run();
  } catch (const Failure& failure) {
    diagnostics.error(failure.at, failure.text);
    return std::nullopt;
  }
}

}  // namespace apron::syntax

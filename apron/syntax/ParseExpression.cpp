// Expressions, by precedence climbing.
#include <fmt/format.h>

#include <algorithm>
#include <tuple>
#include <utility>

#include "apron/syntax/Parser.h"

namespace apron::syntax {
namespace {

constexpr int kNotLevel = 4;
constexpr int kComparisonLevel = 5;

int infix_level(const Token& token) {
  static constexpr std::pair<std::string_view, int> kWords[] = {
      {"or", 1}, {"nor", 1}, {"xor", 2}, {"and", 3}, {"nand", 3}};
  static constexpr std::pair<std::string_view, int> kSymbols[] = {
      {"||", 1}, {"&&", 3}, {"<", 5}, {"<=", 5}, {">", 5}, {">=", 5}, {"==", 5},
      {"!=", 5}, {"+", 6},  {"-", 6}, {"*", 7},  {"/", 7}, {"%", 7}};
  if (token.kind == TokenKind::kName) {
    for (const auto& [text, level] : kWords) {
      if (token.text == text) return level;
    }
  } else if (token.kind == TokenKind::kSymbol) {
    for (const auto& [text, level] : kSymbols) {
      if (token.text == text) return level;
    }
  }
  return 0;
}

bool is_comparison(const Token& token) {
  return token.kind == TokenKind::kSymbol && infix_level(token) == kComparisonLevel;
}

bool is_element(const Tokens& words) {
  return words.size() == 4 && words[0].kind == TokenKind::kName && words[1].is("[") && words[3].is("]");
}

std::vector<Expression> pair(Expression left, Expression right) {
  std::vector<Expression> both;
  both.push_back(std::move(left));
  both.push_back(std::move(right));
  return both;
}

bool is_numeric(const Tokens& words) {
  return std::all_of(words.begin(), words.end(), [](const Token& token) {
    return token.kind == TokenKind::kNumber || token.kind == TokenKind::kSymbol;
  });
}

}  // namespace

class Parser::Nested {
 public:
  explicit Nested(Parser& parser) : parser_(parser) {
    if (++parser_.depth_ > kMaxExpressionDepth) {
      --parser_.depth_;
      parser_.fail(fmt::format("this expression is nested more than {} deep", kMaxExpressionDepth));
    }
  }
  ~Nested() { --parser_.depth_; }
  Nested(const Nested&) = delete;
  Nested& operator=(const Nested&) = delete;

 private:
  Parser& parser_;
};

Location Parser::here() const { return at_end() ? last_ : at_->at; }

void Parser::fail(std::string text) const { throw Failure{here(), std::move(text)}; }

bool Parser::take(std::string_view symbol) {
  if (at_end() || !at_->is(symbol)) return false;
  ++at_;
  return true;
}

Expression Parser::make(ExpressionKind kind, const Token& token, std::vector<Expression> children) const {
  Expression expression;
  expression.kind = kind;
  expression.at = token.at;
  expression.text = token.text;
  expression.number = token.number;
  for (const Expression& child : children) expression.depth = std::max(expression.depth, child.depth + 1);
  if (expression.depth > kMaxExpressionDepth) {
    throw Failure{token.at, fmt::format("this expression is nested more than {} deep", kMaxExpressionDepth)};
  }
  expression.children = std::move(children);
  return expression;
}

// All the words between the two as one expression.
Expression Parser::whole(Cursor first, Cursor last, Location end_at) {
  const auto outer = std::make_tuple(at_, end_, last_);
  at_ = first;
  end_ = last;
  last_ = end_at;
  Expression expression = argument();
  if (!at_end()) fail(fmt::format("unexpected '{}'", spell(*at_)));
  std::tie(at_, end_, last_) = outer;
  return expression;
}

Expression Parser::binary(int level) {
  const Nested nested(*this);
  Expression left = prefix_not();
  while (!at_end()) {
    const int found = infix_level(*at_);
    if (found == 0 || found < level) break;
    const Token op = *at_++;
    Expression right = binary(found + 1);
    left = combine(op, std::move(left), std::move(right));
    if (found == kComparisonLevel && !at_end() && is_comparison(*at_)) {
      fail("comparisons do not chain; join them with 'and'");
    }
  }
  return left;
}

Expression Parser::prefix_not() {
  const bool word = !at_end() && at_->is_name("not") && at_ + 1 != end_ && !at_[1].is("(") && !at_[1].is("[");
  if (!word || infix_level(at_[1]) > 0) return unary();
  const Token op = *at_++;
  std::vector<Expression> operand;
  operand.push_back(binary(kNotLevel));
  return make(ExpressionKind::kUnary, op, std::move(operand));
}

Expression Parser::unary() {
  const Nested nested(*this);
  const bool sign = !at_end() && (at_->is("-") || at_->is("+") || at_->is("!"));
  if (!sign) return primary();
  const Token op = *at_++;
  std::vector<Expression> operand;
  operand.push_back(unary());
  return make(ExpressionKind::kUnary, op, std::move(operand));
}

Expression Parser::primary() {
  if (take("(")) {
    Expression inner = binary(1);
    if (!take(")"))
      fail(at_end() ? "expected ')' before the end of the line"
                    : fmt::format("expected ')', not '{}'", spell(*at_)));
    return inner;
  }
  if (at_end()) fail("expected a value");
  const Token& token = *at_;
  switch (token.kind) {
    case TokenKind::kNumber:
      ++at_;
      return make(ExpressionKind::kNumber, token);
    case TokenKind::kText:
      ++at_;
      return make(ExpressionKind::kText, token);
    case TokenKind::kName:
      return name();
    case TokenKind::kParameter:
      fail(fmt::format("there is no macro parameter '{}' here", spell(token)));
    case TokenKind::kLocal:
    case TokenKind::kLocalLabel:
      fail(fmt::format("'{}' has a meaning in a macro's body only", spell(token)));
    default:
      fail(fmt::format("expected a value, not '{}'", spell(token)));
  }
}

Expression Parser::name() {
  const Token token = *at_++;
  if (!at_end() && at_->is("(")) return call(token);
  if (!at_end() && at_->is("[")) return element(token);
  if (const MacroTable::Handle macro = preprocessor_.find(token.text, 0, true))
    return expand(macro, token, {});
  return make(ExpressionKind::kName, token);
}

Expression Parser::element(const Token& name) {
  ++at_;
  std::vector<Expression> index;
  index.push_back(binary(1));
  if (!take("]")) fail("expected ']'");
  return make(ExpressionKind::kElement, name, std::move(index));
}

Parser::Cursor Parser::closing(Cursor open) const {
  int depth = 0;
  for (Cursor at = open; at != end_; ++at) {
    if (at->is("(") || at->is("[")) ++depth;
    if ((at->is(")") || at->is("]")) && --depth == 0) return at;
  }
  throw Failure{open->at, "this bracket is not closed"};
}

// From the '(' after the name.
Expression Parser::call(const Token& name) {
  const Nested nested(*this);
  if (preprocessor_.macros().has(name.text)) {
    const Cursor close = closing(at_);
    const std::vector<Tokens> words = split_arguments(at_ + 1, close);
    const MacroTable::Handle macro = preprocessor_.find(name.text, words.size(), true);
    if (macro != nullptr) {
      std::vector<Argument> arguments = read_arguments(name, words);
      at_ = close + 1;
      return expand(macro, name, std::move(arguments));
    }
    if (!preprocessor_.is_builtin(name.text)) no_overload(name, words.size(), true);
  }
  ++at_;
  std::vector<Expression> arguments;
  if (!take(")")) {
    do {
      arguments.push_back(argument());
    } while (take(","));
    if (!take(")")) {
      fail(at_end()       ? "expected ')' before the end of the line"
           : at_->is("=") ? "'=' gives a value to a name; to compare, write '=='"
                          : fmt::format("expected ',' or ')', not '{}'", spell(*at_)));
    }
  }
  return make(ExpressionKind::kCall, name, std::move(arguments));
}

Expression Parser::argument() {
  const bool alone = !at_end() && (at_ + 1 == end_ || at_[1].is(",") || at_[1].is(")"));
  if (alone && is_comparison(*at_)) return make(ExpressionKind::kOperator, *at_++);
  if (!at_end() && at_->kind == TokenKind::kLabel) return make(ExpressionKind::kLabel, *at_++);
  if (!at_end() && at_->is("?")) return module();
  return binary(1);
}

// In a macro's body it is the module that was current where the macro was defined.
Expression Parser::module() {
  Token token = *at_;
  if (preprocessor_.module().empty())
    fail("'?' stands for the module loaded last, and there is no '!module' before");
  ++at_;
  token.text = preprocessor_.module();
  return make(ExpressionKind::kModule, token);
}

Expression Parser::combine(const Token& op, Expression left, Expression right) {
  const bool constant = left.kind == ExpressionKind::kNumber && right.kind == ExpressionKind::kNumber;
  const std::string target = constant ? "" : preprocessor_.operator_target(op.text);
  const MacroTable::Handle macro = preprocessor_.macros().find(target, 2, true);
  const bool in_its_own_body = macro != nullptr && preprocessor_.expanding(macro);
  if (!target.empty() && !in_its_own_body) {
    Token call = op;
    call.kind = TokenKind::kName;
    call.text = target;
    if (macro != nullptr) {
      std::vector<Argument> arguments(2);
      arguments[0].value = std::move(left);
      arguments[1].value = std::move(right);
      return expand(macro, call, std::move(arguments));
    }
    if (!preprocessor_.is_builtin(target)) {
      throw Failure{op.at,
                    fmt::format("'{}' stands for '{}', which is not an instruction or macro of two arguments",
                                op.text, target)};
    }
    return make(ExpressionKind::kCall, call, pair(std::move(left), std::move(right)));
  }
  return make(ExpressionKind::kBinary, op, pair(std::move(left), std::move(right)));
}

std::vector<Parser::Argument> Parser::read_arguments(const Token& call, const std::vector<Tokens>& list) {
  std::vector<Argument> arguments;
  for (const Tokens& words : list) {
    if (words.empty()) throw Failure{call.at, fmt::format("an argument of '{}' is empty", call.text)};
    Argument argument;
    if (words.size() == 1 || is_element(words)) {
      argument.words = words;
    } else if (is_numeric(words)) {
      argument.words.push_back({TokenKind::kSymbol, words.front().at, "(", 0.0F});
      argument.words.insert(argument.words.end(), words.begin(), words.end());
      argument.words.push_back({TokenKind::kSymbol, words.back().at, ")", 0.0F});
    } else {
      Location end_at = words.back().at;
      end_at.column += static_cast<std::uint32_t>(spell(words.back()).size());
      argument.value = whole(words.begin(), words.end(), end_at);
    }
    arguments.push_back(std::move(argument));
  }
  return arguments;
}

// What takes the parameters' places: the words themselves, or a unique name for a value.
std::vector<Tokens> Parser::bind(MacroExpansion& expansion, const Macro& macro,
                                 std::vector<Argument> arguments, Location at) {
  std::vector<Tokens> places;
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    Argument& argument = arguments[i];
    if (argument.value) {
      std::string unique = fmt::format("${}:{}", macro.parameters[i], expansion.id);
      places.push_back({{TokenKind::kName, argument.value->at, unique, 0.0F}});
      expansion.bindings.push_back({std::move(unique), std::move(*argument.value)});
      continue;
    }
    const Tokens& words = argument.words;
    if (words.size() == 1 && words[0].kind == TokenKind::kName) {
      expansion.words.push_back(make(ExpressionKind::kName, words[0]));
    } else if (is_element(words)) {
      const bool number = words[2].kind == TokenKind::kNumber;
      std::vector<Expression> index;
      index.push_back(make(number ? ExpressionKind::kNumber : ExpressionKind::kName, words[2]));
      expansion.words.push_back(make(ExpressionKind::kElement, words[0], std::move(index)));
    }
    for (Token& word : argument.words) {
      if (word.at.line == 0) word.at = at;
    }
    places.push_back(std::move(argument.words));
  }
  return places;
}

// A macro inside an expression: its lines are parsed here and now.
Expression Parser::expand(const MacroTable::Handle& macro, const Token& call,
                          std::vector<Argument> arguments) {
  const Nested nested(*this);
  Expression expression = make(ExpressionKind::kExpansion, call);
  expression.expansion = std::make_shared<MacroExpansion>();
  MacroExpansion& expansion = *expression.expansion;
  expansion.macro = macro->name;
  expansion.id = sources_.add_expansion(macro->name, call.at);
  expansion.result = fmt::format("${}:{}", macro->result, expansion.id);
  std::vector<Tokens> places = bind(expansion, *macro, std::move(arguments), call.at);
  const std::size_t floor = preprocessor_.depth();
  Tokens result{{TokenKind::kName, call.at, expansion.result, 0.0F}};
  if (!preprocessor_.enter(macro, expansion.id, std::move(result), std::move(places))) {
    throw Failure{call.at, {}};  // reported
  }
  lines(floor, expansion.body);
  std::size_t deepest = 0;
  for (const Statement& statement : expansion.body) {
    deepest = std::max({deepest, statement.target.depth, statement.value.depth});
    if (statement.expansion == nullptr) continue;
    for (const Binding& binding : statement.expansion->bindings)
      deepest = std::max(deepest, binding.value.depth);
  }
  for (const Binding& binding : expansion.bindings) deepest = std::max(deepest, binding.value.depth);
  expression.depth = deepest + 1;
  if (expression.depth > kMaxExpressionDepth) {
    throw Failure{call.at, fmt::format("this expression is nested more than {} deep", kMaxExpressionDepth)};
  }
  return expression;
}

void Parser::no_overload(const Token& call, std::size_t arguments, bool result) const {
  std::string known;
  for (const std::string& pattern : preprocessor_.macros().patterns(call.text)) {
    known += (known.empty() ? "" : " and ") + pattern;
  }
  throw Failure{
      call.at, fmt::format("no macro '{}' takes {} argument{} {} a result; there is {}", call.text, arguments,
                           arguments == 1 ? "" : "s", result ? "and gives" : "without", known)};
}

}  // namespace apron::syntax

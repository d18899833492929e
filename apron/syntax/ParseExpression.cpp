// Expressions, by precedence climbing.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "apron/syntax/Constant.h"
#include "apron/syntax/Parser.h"

namespace apron::syntax {
namespace {

bool is_comparison(const Token& token) {
  return token.kind == TokenKind::kPunctuator && infix_precedence(token) == kComparisonPrecedence;
}

bool is_element_access(const Tokens& tokens) {
  return tokens.size() == 4 && tokens[0].kind == TokenKind::kName && tokens[1].is("[") && tokens[3].is("]");
}

template <class... Expressions>
std::vector<Expression> children(Expressions&&... expressions) {
  std::vector<Expression> all;
  (all.push_back(std::forward<Expressions>(expressions)), ...);
  return all;
}

// Numbers and operators alone.
bool is_numeric_constant(const Tokens& tokens) {
  const auto is_number = [](const Token& token) { return token.kind == TokenKind::kNumber; };
  return std::ranges::any_of(tokens, is_number) && std::ranges::all_of(tokens, [&](const Token& token) {
           return is_number(token) || token.kind == TokenKind::kPunctuator || infix_precedence(token) != 0 ||
                  token.is_name("not");
         });
}

// As the source could write it.
Token number_token(double number, Location location) {
  const bool is_whole = number == std::trunc(number);
  return {TokenKind::kNumber, location,
          is_whole ? fmt::format("{}", number) : fmt::format("{}", static_cast<float>(number)), number};
}

// c[3] for c[2 + 1].
Tokens with_constant_index(const Tokens& tokens, Diagnostics& diagnostics) {
  if (tokens.size() < 5 || tokens[0].kind != TokenKind::kName || !tokens[1].is("[") || !tokens.back().is("]"))
    return tokens;
  const Tokens index(tokens.begin() + 2, tokens.end() - 1);
  if (!is_numeric_constant(index) ||
      std::ranges::any_of(index, [](const Token& token) { return token.is("]"); }))
    return tokens;
  const auto value = evaluate_constant(index, index.front().location, diagnostics);
  if (!value) return tokens;
  return {tokens[0], tokens[1], number_token(value->number, index.front().location), tokens.back()};
}

}  // namespace

class Parser::DepthGuard {
 public:
  explicit DepthGuard(Parser& parser) : parser_(parser) {
    if (++parser_.depth_ > kMaxExpressionDepth) {
      --parser_.depth_;
      parser_.fail("{}", parser_.too_deep());
    }
  }
  ~DepthGuard() { --parser_.depth_; }
  DepthGuard(const DepthGuard&) = delete;
  DepthGuard& operator=(const DepthGuard&) = delete;

 private:
  Parser& parser_;
};

Location Parser::current_location() const { return at_end() ? line_end_ : place(*cursor_); }

bool Parser::consume(std::string_view symbol) {
  if (at_end() || !cursor_->is(symbol)) return false;
  ++cursor_;
  return true;
}

std::string Parser::too_deep() const {
  return fmt::format("this expression is nested more than {} deep{}", kMaxExpressionDepth,
                     preprocessor_.endless_function());
}

void Parser::check_depth(const Expression& expression) const {
  if (expression.depth > kMaxExpressionDepth) fail_at(expression.location, "{}", too_deep());
  if (expression.height > kMaxExpressionHeight)
    fail_at(expression.location, "this expression has more than {} operators in a chain: write several lines",
            kMaxExpressionHeight - 1);
}

Expression Parser::make_expression(ExpressionKind kind, const Token& token,
                                   std::vector<Expression> children) const {
  Expression expression;
  expression.kind = kind;
  expression.location = token.location;
  expression.text = token.text;
  expression.number = token.number;
  expression.owner = token.owner;
  for (const Expression& child : children) {
    const bool is_chain = kind == ExpressionKind::kBinary && &child == children.data() && child.kind == kind;
    expression.depth = std::max(expression.depth, child.depth + (is_chain ? 0 : 1));
    expression.height = std::max(expression.height, child.height + 1);
  }
  check_depth(expression);
  expression.children = std::move(children);
  return expression;
}

// All tokens between the two as one expression.
Expression Parser::parse_range(Cursor first, Cursor last, Location end_location) {
  const auto saved = std::make_tuple(cursor_, end_, line_end_);
  cursor_ = first;
  end_ = last;
  line_end_ = end_location;
  Expression expression = parse_argument();
  if (!at_end())
    fail("unexpected '{}'{}", spelling(*cursor_),
         cursor_->is("?") ? "; 'a ? b : c' is select(a, b, c)"
         : cursor_->kind == TokenKind::kName || cursor_->kind == TokenKind::kLocalName
             ? "; a statement ends with its line"
             : "");
  std::tie(cursor_, end_, line_end_) = saved;
  return expression;
}

Expression Parser::parse_binary(int level) {
  const DepthGuard nested(*this);
  Expression left = parse_not(level);
  while (!at_end()) {
    const int precedence = infix_precedence(*cursor_);
    if (precedence == 0 || precedence < level) break;
    const Token op = *cursor_++;
    if (op.is("*") && !at_end() && cursor_->is("*"))
      fail_at(op.location, "there is no '**'; a power is pow(a, b)");
    Expression right = parse_binary(precedence + 1);
    left = make_binary(op, std::move(left), std::move(right));
    if (precedence == kComparisonPrecedence && !at_end() && is_comparison(*cursor_)) {
      fail("comparisons do not chain; join them with 'and'");
    }
  }
  return left;
}

// True if a `not` before it is the operator (`not -a`, `not nor(a, b)`) rather than the call not(a).
bool Parser::begins_operand(Cursor first) const {
  if (first->is("(") || first->is("[")) return false;
  if (infix_precedence(*first) == 0 || first->is("-") || first->is("+")) return true;
  return first->kind == TokenKind::kName && first + 1 != end_ && first[1].is("(");
}

bool Parser::is_negation_operator() const {
  return !at_end() && cursor_->is_name("not") && cursor_ + 1 != end_ && begins_operand(cursor_ + 1);
}

// On the right of an operator that binds tighter, of which `level` tells, `not` takes one operand. In
// `2 * not a + 1` the sum has two readings.
Expression Parser::parse_not(int level) {
  if (!is_negation_operator()) return parse_unary();
  const Token op = *cursor_++;
  if (level <= kNotPrecedence)
    return make_expression(ExpressionKind::kUnary, op, children(parse_binary(kNotPrecedence)));
  const DepthGuard nested(*this);
  Expression operand = parse_not(level);
  if (!at_end() && infix_precedence(*cursor_) > kNotPrecedence)
    fail_at(op.location,
            "'not … {0} …' after an operator has two readings: write not (… {0} …) or (not …) {0} …",
            cursor_->text);
  return make_expression(ExpressionKind::kUnary, op, children(std::move(operand)));
}

Expression Parser::parse_unary() {
  const bool is_prefix =
      !at_end() && (cursor_->is("-") || cursor_->is("+") || cursor_->is("!") || cursor_->is("~"));
  if (!is_prefix) return parse_primary();
  const DepthGuard nested(*this);
  const Token op = *cursor_++;
  Expression operand = parse_not(kTightest);
  // `!operator(-, m)` where m has one operand: -a is m(a).
  const MacroTable::Handle macro =
      preprocessor_.macros().find(preprocessor_.operator_target(op.text), 1, true);
  if (macro != nullptr && !preprocessor_.is_expanding(macro)) {
    Token call = op;
    call.kind = TokenKind::kName;
    call.text = macro->name;
    std::vector<MacroArgument> arguments(1);
    arguments[0].value = std::move(operand);
    return expand_macro(macro, call, std::move(arguments));
  }
  return make_expression(ExpressionKind::kUnary, op, children(std::move(operand)));
}

Expression Parser::parse_primary() {
  if (consume("(")) {
    Expression inner = parse_binary(1);
    if (!consume(")"))
      fail("{}", at_end() ? "expected ')' before the end of the line"
                          : fmt::format("expected ')', not '{}'", spelling(*cursor_)));
    return inner;
  }
  if (at_end()) fail("expected a value");
  const Token& token = *cursor_;
  switch (token.kind) {
    case TokenKind::kNumber:
      ++cursor_;
      return make_expression(ExpressionKind::kNumber, token);
    case TokenKind::kString:
      ++cursor_;
      return make_expression(ExpressionKind::kString, token);
    case TokenKind::kName:
      return parse_name();
    case TokenKind::kParameter:
      fail("there is no macro parameter '{}' here", spelling(token));
    case TokenKind::kLocalName:
    case TokenKind::kLocalLabel:
      fail("'{}' has a meaning in a macro's body only", spelling(token));
    default:
      fail("expected a value, not '{}'", spelling(token));
  }
}

Expression Parser::parse_name() {
  const Token token = *cursor_++;
  if (!at_end() && cursor_->is("(")) return parse_call(token);
  if (!at_end() && cursor_->is("[")) return parse_element(token);
  if (const MacroTable::Handle macro = preprocessor_.find_macro(token.text, 0, true))
    return expand_macro(macro, token, {});
  return make_expression(ExpressionKind::kName, token);
}

Expression Parser::parse_element(const Token& name) {
  ++cursor_;
  Expression index = parse_binary(1);
  if (!consume("]")) fail("expected ']'");
  return make_expression(ExpressionKind::kElement, name, children(std::move(index)));
}

Parser::Cursor Parser::find_closing_bracket(Cursor open) const {
  int depth = 0;
  for (Cursor it = open; it != end_; ++it) {
    if (it->is("(") || it->is("[")) ++depth;
    if ((it->is(")") || it->is("]")) && --depth == 0) return it;
  }
  fail_at(open->location, "this bracket is not closed");
}

// Starts at the '(' after the name.
Expression Parser::parse_call(const Token& name) {
  if (name.is_name("not")) check_negation(name);
  if (preprocessor_.macros().contains(name.text)) {
    const Cursor close = find_closing_bracket(cursor_);
    const std::vector<Tokens> argument_tokens = split_arguments(cursor_ + 1, close);
    const MacroTable::Handle macro = preprocessor_.find_macro(name.text, argument_tokens.size(), true);
    if (macro != nullptr) {
      check_operands(name, *macro, argument_tokens);
      std::vector<MacroArgument> arguments = parse_macro_arguments(name, argument_tokens);
      cursor_ = close + 1;
      return expand_macro(macro, name, std::move(arguments));
    }
    if (!preprocessor_.is_builtin(name.text)) fail_no_overload(name, argument_tokens.size(), true);
  }
  ++cursor_;
  std::vector<Expression> arguments;
  if (!consume(")")) {
    do {
      arguments.push_back(parse_argument());
    } while (consume(","));
    if (!consume(")")) {
      fail("{}", at_end()           ? "expected ')' before the end of the line"
                 : cursor_->is("=") ? "'=' gives a value to a name; to compare, write '=='"
                                    : fmt::format("expected ',' or ')', not '{}'", spelling(*cursor_)));
    }
  }
  return make_expression(ExpressionKind::kCall, name, std::move(arguments));
}

// Refuses `not (a) > b` and `not (a) + b`, which read as the operator `not` and would be the call not(a).
// Before `and` and the like both readings are the same.
void Parser::check_negation(const Token& name) const {
  const Cursor close = find_closing_bracket(cursor_);
  if (close + 1 == end_ || infix_precedence(close[1]) <= kNotPrecedence) return;
  fail_at(name.location,
          "'not (…) {0} …' has two readings: write not ((…) {0} …) or "
          "(not (…)) {0} …",
          close[1].text);
}

Expression Parser::parse_argument() {
  const bool alone = !at_end() && (cursor_ + 1 == end_ || cursor_[1].is(",") || cursor_[1].is(")"));
  if (alone && is_comparison(*cursor_)) return make_expression(ExpressionKind::kOperator, *cursor_++);
  if (!at_end() && cursor_->kind == TokenKind::kLabel)
    return make_expression(ExpressionKind::kLabel, *cursor_++);
  if (!at_end() && cursor_->is("?")) return parse_module();
  return parse_binary(1);
}

// In a macro's body, '?' is the module that was current where the macro was defined.
Expression Parser::parse_module() {
  Token token = *cursor_;
  if (preprocessor_.module().empty())
    fail("'?' stands for the module loaded last, and there is no '!module' before");
  ++cursor_;
  token.text = preprocessor_.module();
  return make_expression(ExpressionKind::kModule, token);
}

Expression Parser::make_binary(const Token& op, Expression left, Expression right) {
  const std::string target = preprocessor_.operator_target(op.text);
  const MacroTable::Handle macro = preprocessor_.macros().find(target, 2, true);
  const bool is_recursive = macro != nullptr && preprocessor_.is_expanding(macro);
  const bool is_prefix = macro == nullptr && preprocessor_.macros().find(target, 1, true) != nullptr;
  if (!target.empty() && !is_recursive && !is_prefix) {
    Token call = op;
    call.kind = TokenKind::kName;
    call.text = target;
    if (macro != nullptr) {
      std::vector<MacroArgument> arguments(2);
      arguments[0].value = std::move(left);
      arguments[1].value = std::move(right);
      return expand_macro(macro, call, std::move(arguments));
    }
    if (!preprocessor_.is_builtin(target)) {
      fail_at(op.location, "'{}' stands for '{}', which is not an instruction or macro of two arguments",
              op.text, target);
    }
    return make_expression(ExpressionKind::kCall, call, children(std::move(left), std::move(right)));
  }
  return make_expression(ExpressionKind::kBinary, op, children(std::move(left), std::move(right)));
}

// True if an `!operator` gives one of the tokens another meaning.
bool Parser::mentions_rebound(const Tokens& tokens) const {
  return std::ranges::any_of(
      tokens, [&](const Token& token) { return !preprocessor_.operator_target(token.text).empty(); });
}

std::vector<Parser::MacroArgument> Parser::parse_macro_arguments(const Token& call,
                                                                 const std::vector<Tokens>& argument_tokens) {
  std::vector<MacroArgument> arguments;
  for (const Tokens& written : argument_tokens) {
    const Tokens tokens = with_constant_index(written, diagnostics_);
    if (tokens.empty()) fail_at(call.location, "an argument of '{}' is empty", call.text);
    MacroArgument argument;
    if (tokens.size() == 1 || is_element_access(tokens)) {
      argument.tokens = tokens;
    } else if (is_numeric_constant(tokens) && !mentions_rebound(tokens)) {
      const auto constant = evaluate_constant(tokens, tokens.front().location, diagnostics_);
      if (!constant) throw AlreadyReported{};
      argument.tokens = {number_token(constant->number, tokens.front().location)};
    } else if (is_numeric_constant(tokens)) {
      argument.tokens.push_back({TokenKind::kPunctuator, tokens.front().location, "(", 0.0F});
      argument.tokens.insert(argument.tokens.end(), tokens.begin(), tokens.end());
      argument.tokens.push_back({TokenKind::kPunctuator, tokens.back().location, ")", 0.0F});
    } else {
      Location end_location = tokens.back().location;
      end_location.column += static_cast<std::uint32_t>(spelling(tokens.back()).size());
      argument.value = parse_range(tokens.begin(), tokens.end(), end_location);
    }
    arguments.push_back(std::move(argument));
  }
  return arguments;
}

// Returns what replaces the parameters: the tokens themselves, or a unique name for a value.
std::vector<Tokens> Parser::bind_arguments(MacroExpansion& expansion, const Macro& macro,
                                           std::vector<MacroArgument> arguments, Location location) {
  expansion.is_function = macro.is_function;
  expansion.results = macro.further_results;
  expansion.results.push_back(macro.result_parameter);
  std::vector<Tokens> replacements;
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    MacroArgument& argument = arguments[i];
    const MacroParameter& parameter = macro.parameters[i];
    if (parameter.type == ArgumentType::kInteger) check_integer(parameter, macro, argument, location);
    if (argument.value) {
      std::string unique =
          fmt::format("${}{}{}", parameter.name, macro.is_function ? "::" : ":", expansion.id);
      replacements.push_back({{TokenKind::kName, argument.value->location, unique, 0.0F}});
      expansion.bindings.push_back({std::move(unique), std::move(*argument.value)});
    }
    Argument bound = make_argument(parameter.name, argument.value ? replacements.back() : argument.tokens);
    bound.type = parameter.type;
    bound.is_array = parameter.is_array;
    if (bound.type != ArgumentType::kAny && bound.value.kind == ExpressionKind::kOperator &&
        argument.tokens.size() == 1)
      fail_at(location, "'{}' cannot be the argument '{}' of '{}'", bound.value.text, parameter.name,
              macro.name);
    expansion.arguments.push_back(std::move(bound));
    if (argument.value) continue;
    for (Token& token : argument.tokens) {
      if (token.location.line == 0) token.location = location;
    }
    replacements.push_back(std::move(argument.tokens));
  }
  return replacements;
}

Argument Parser::make_argument(const std::string& parameter, const Tokens& written) const {
  Diagnostics reported_in_the_body;
  const Tokens tokens = with_constant_index(written, reported_in_the_body);
  const Token& first = tokens.front();
  std::string text;
  for (const Token& token : tokens) text += spelling(token);
  const auto kind_of = [](const Token& token) {
    return token.kind == TokenKind::kNumber   ? ExpressionKind::kNumber
           : token.kind == TokenKind::kName   ? ExpressionKind::kName
           : token.kind == TokenKind::kString ? ExpressionKind::kString
                                              : ExpressionKind::kOperator;
  };
  Expression value = make_expression(tokens.size() == 1 ? kind_of(first) : ExpressionKind::kOperator, first);
  if (is_element_access(tokens)) {
    value = make_expression(ExpressionKind::kElement, first,
                            children(make_expression(kind_of(tokens[2]), tokens[2])));
  }
  if (value.kind == ExpressionKind::kOperator) value.text = std::move(text);
  return {parameter, ArgumentType::kAny, false, std::move(value)};
}

// Replaces the argument by its value.
void Parser::check_integer(const MacroParameter& parameter, const Macro& macro, MacroArgument& argument,
                           Location location) {
  std::optional<Constant> value;
  if (is_numeric_constant(argument.tokens))
    value = evaluate_constant(argument.tokens, location, diagnostics_);
  if (!value || value->is_string || value->number != std::floor(value->number))
    fail_at(location, "'{}' takes a whole number that is a constant for '{}'", macro.name, parameter.name);
  argument.tokens = {number_token(value->number, argument.tokens.front().location)};
}

// A macro inside an expression: its lines are parsed at once.
Expression Parser::expand_macro(const MacroTable::Handle& macro, const Token& call,
                                std::vector<MacroArgument> arguments) {
  const DepthGuard nested(*this);
  Expression expression = make_expression(ExpressionKind::kExpansion, call);
  expression.expansion = std::make_shared<MacroExpansion>();
  MacroExpansion& expansion = *expression.expansion;
  if (!macro->further_results.empty())
    fail_at(call.location, "'{}' gives {} results: write a line {}", macro->name,
            macro->further_results.size() + 1, signature(*macro));
  expansion.macro = macro->name;
  expansion.id =
      sources_.add_expansion(macro->name, call.location, macro->parameters.size(), macro->is_function);
  expansion.result_name = fmt::format("${}:{}", macro->result_parameter, expansion.id);
  std::vector<Tokens> replacements = bind_arguments(expansion, *macro, std::move(arguments), call.location);
  const std::size_t min_depth = preprocessor_.depth();
  Tokens result{{TokenKind::kName, call.location, expansion.result_name, 0.0F}};
  if (!preprocessor_.enter_macro(macro, expansion.id, {std::move(result)}, std::move(replacements))) {
    throw AlreadyReported{};
  }
  parse_lines(min_depth, expansion.body);
  const auto contain = [&](const Expression& inner) {
    expression.depth = std::max(expression.depth, inner.depth + 1);
    expression.height = std::max(expression.height, inner.height + 1);
  };
  for (const Statement& statement : expansion.body) {
    contain(statement.target);
    contain(statement.value);
    if (statement.expansion == nullptr) continue;
    for (const ArgumentBinding& binding : statement.expansion->bindings) contain(binding.value);
  }
  for (const ArgumentBinding& binding : expansion.bindings) contain(binding.value);
  check_depth(expression);
  return expression;
}

// Refuses an operand that is not of the kind that the macro's pattern states.
void Parser::check_operands(const Token& call, const Macro& macro,
                            const std::vector<Tokens>& operands) const {
  for (std::size_t i = 0; i < operands.size(); ++i) {
    const std::string& kind = macro.parameters[i].kind;
    if (kind.empty() || operands[i].empty()) continue;
    const std::string mistake = preprocessor_.check_operand(kind, operands[i]);
    if (mistake.empty()) continue;
    fail_at(operands[i].front().location, "operand {} of '{}' {}", i + 1, call.text, mistake);
  }
}

void Parser::fail_no_overload(const Token& call, std::size_t arguments, bool result) const {
  std::string overloads;
  for (const std::string& pattern : preprocessor_.macros().signatures(call.text)) {
    overloads += (overloads.empty() ? "" : " and ") + pattern;
  }
  fail_at(call.location, "no macro '{}' takes {} argument{} {} a result; there is {}", call.text, arguments,
          arguments == 1 ? "" : "s", result ? "and gives" : "without", overloads);
}

}  // namespace apron::syntax

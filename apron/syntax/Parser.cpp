#include "apron/syntax/Parser.h"

#include <fmt/format.h>

#include <algorithm>
#include <tuple>
#include <utility>

namespace apron::syntax {
namespace {

// A hint how APRON writes a line in another language's syntax, or "".
std::string suggest_correction(const Token& first, bool has_arguments, const Token& unexpected) {
  if (unexpected.is("==")) return "; to give a value, write '='";
  if (unexpected.is("+") || unexpected.is("-") || unexpected.is("*") || unexpected.is("/")) {
    return fmt::format("; write {0} = {0} {1} …", spelling(first), unexpected.text);
  }
  if (first.is_name("else") && unexpected.is_name("if"))
    return "; write 'else', and an 'if' with its own 'endif' after it";
  if (first.is_name("return")) return "; a function's result is what it writes: y = …";
  if (first.is_name("goto")) return fmt::format("; write jump(#{})", spelling(unexpected));
  const bool needs_parentheses = first.is_name("if") || first.is_name("while") || first.is_name("for") ||
                                 first.is_name("repeat") || first.is_name("where") ||
                                 first.is_name("print") || first.is_name("println");
  if (has_arguments) return unexpected.kind == TokenKind::kName ? "; a statement ends with its line" : "";
  return needs_parentheses ? fmt::format("; write {}(…)", first.text) : "";
}

}  // namespace

Parser::Parser(Preprocessor& preprocessor, SourceManager& sources, Diagnostics& diagnostics)
    : preprocessor_(preprocessor), sources_(sources), diagnostics_(diagnostics) {}

std::vector<Statement> Parser::parse() {
  std::vector<Statement> program;
  parse_lines(0, program);
  return program;
}

void Parser::parse_lines(std::size_t min_depth, std::vector<Statement>& out) {
  for (;;) {
    PreprocessedItem item = preprocessor_.next(min_depth);
    switch (item.kind) {
      case PreprocessedItem::Kind::kEndOfInput:
        return;
      case PreprocessedItem::Kind::kLine:
        parse_line(item.line, out);
        break;
      case PreprocessedItem::Kind::kDeclaration:
        add_declaration(std::move(item.declaration), out);
        break;
      case PreprocessedItem::Kind::kMacroEnd:
        out.emplace_back();
        out.back().kind = StatementKind::kMacroEnd;
        out.back().expansion_id = item.expansion;
        break;
    }
  }
}

void Parser::add_declaration(Declaration declaration, std::vector<Statement>& out) const {
  Statement statement;
  statement.kind = StatementKind::kDeclare;
  statement.location = declaration.location;
  statement.declaration = std::make_shared<Declaration>(std::move(declaration));
  out.push_back(std::move(statement));
}

void Parser::parse_line(const Line& line, std::vector<Statement>& out) {
  if (line.has_error) return out.push_back(make_invalid(line));
  const auto saved = std::make_tuple(cursor_, end_, line_end_, line_begin_, depth_);
  line_begin_ = line.location;
  cursor_ = line.tokens.begin();
  end_ = line.tokens.end();
  line_end_ = line.end;
  try {
    out.push_back(parse_statement());
  } catch (const SyntaxError& error) {
    diagnostics_.error(error.location, error.message);
    out.push_back(make_invalid(line));
  } catch (const AlreadyReported&) {
    out.push_back(make_invalid(line));
  }
  std::tie(cursor_, end_, line_end_, line_begin_, depth_) = saved;
}

Statement Parser::make_invalid(const Line& line) const {
  Statement statement;
  statement.location = line.location;
  statement.target.text = line.tokens.front().text;
  // `if(a) b = c` counts as a block, not as an assignment.
  const bool opens_block =
      is_keyword(statement.target.text) && line.tokens.size() > 1 && line.tokens[1].is("(");
  statement.assigns =
      !opens_block && find_equals(line.tokens.begin(), line.tokens.end()) != line.tokens.end();
  // The instruction where(A) of a machine opens no block.
  if (!statement.assigns && preprocessor_.macros().has_operand_kinds(statement.target.text))
    statement.target.text.clear();
  return statement;
}

Statement Parser::parse_statement() {
  const Token& first = *cursor_;
  Statement result;
  result.location = line_begin_;
  if (first.kind == TokenKind::kLabel) {
    result.kind = StatementKind::kLabel;
    result.target = make_expression(ExpressionKind::kLabel, first);
    if (++cursor_ != end_) fail("a label stands alone on its line");
    return result;
  }
  const Cursor equals = find_equals(cursor_, end_);
  if (equals != end_) return parse_assignment(equals);
  if (first.kind == TokenKind::kParameter || first.kind == TokenKind::kLocalName)
    parse_range(cursor_, end_, line_end_);
  if (first.kind != TokenKind::kName)
    fail("a line cannot begin with '{}'{}", spelling(first),
         first.is("/") ? "; a comment begins with '//'" : "");
  if (auto macro = parse_macro_statement(cursor_, end_, {})) return std::move(*macro);
  const bool is_call =
      cursor_ + 1 == end_ || (cursor_[1].is("(") && find_closing_bracket(cursor_ + 1) + 1 == end_);
  if (!is_call) {
    const bool has_arguments = cursor_[1].is("(");
    const Cursor unexpected = has_arguments ? find_closing_bracket(cursor_ + 1) + 1 : cursor_ + 1;
    cursor_ = unexpected;
    fail("expected '=' or the end of the line, not '{}'{}", spelling(*unexpected),
         suggest_correction(first, has_arguments, *unexpected));
  }
  result.kind = StatementKind::kCall;
  if (cursor_ + 1 == end_) {
    result.value = make_expression(ExpressionKind::kName, first);
  } else {
    ++cursor_;
    result.value = parse_call(first);
  }
  return result;
}

Statement Parser::parse_assignment(Cursor equals) {
  const Cursor first = cursor_;
  const Cursor last = end_;
  if (equals == first) fail("expected a name before '='");
  const bool is_compound = equals - first > 1 && equals[-1].kind == TokenKind::kPunctuator &&
                           equals[-1].location.line == equals->location.line &&
                           equals[-1].text.find_first_of("+-*/%") == 0;
  if (is_compound) {
    fail_at(equals[-1].location, "there is no '{0}='; write {1} = {1} {0} …", equals[-1].text,
            spelling(*first));
  }
  std::vector<Tokens> targets = split_arguments(first, equals);
  const bool is_list = targets.size() > 1;
  for (const Tokens& target : targets)
    if (target.empty()) fail_at(equals->location, "expected a name before '='");
  if (auto macro = parse_macro_statement(equals + 1, last, std::move(targets))) return std::move(*macro);
  if (is_list)
    fail_at(equals->location, "only a function that gives several results can stand after this '='");
  if (auto macro = parse_rebound_assignment(first, equals, last)) return std::move(*macro);
  Statement result;
  result.kind = StatementKind::kAssign;
  result.location = line_begin_;
  result.target = parse_range(first, equals, equals->location);
  const ExpressionKind kind = result.target.kind;
  if (kind != ExpressionKind::kName && kind != ExpressionKind::kElement) {
    fail_at(first->location, "only a register, an element or a scalar can stand before '='");
  }
  if (equals + 1 == last) fail_at(line_end_, "expected a value after '='");
  result.value = parse_range(equals + 1, last, line_end_);
  return result;
}

// y = value where `!operator(=, name)` has made it name(y, value), a macro, or y = name(value). Names without
// a comma are operands of their own: y = a b is name(y, a, b), y = nothing is name(y), and y z = a is
// name2(y, z, a). An instruction of two arguments, such as core.load, assigns as '=' does.
std::optional<Statement> Parser::parse_rebound_assignment(Cursor first, Cursor equals, Cursor last) {
  std::string target = preprocessor_.operator_target("=");
  if (target.empty() || preprocessor_.assigns_plainly()) return std::nullopt;
  const MacroTable& macros = preprocessor_.macros();
  const auto are_names = [](Cursor from, Cursor to) {
    return std::all_of(
        from, to, [](const Token& token) { return token.kind == TokenKind::kName && !token.is_name("not"); });
  };
  const bool has_targets = equals - first > 1 && are_names(first, equals);
  const bool is_list = (has_targets || last - equals != 2) && are_names(equals + 1, last);
  if (equals + 1 == last && macros.find(target, 1, false) == nullptr) return std::nullopt;
  if (has_targets) target += std::to_string(equals - first);
  const std::size_t count = is_list ? last - equals - 1 + (has_targets ? equals - first : 1) : 2;
  MacroTable::Handle macro = macros.find(target, count, false);
  const bool has_result = macro == nullptr && !is_list && macros.find(target, 1, true) != nullptr;
  if (has_result) macro = macros.find(target, 1, true);
  if (macro == nullptr && !preprocessor_.is_builtin(target)) {
    fail_at(equals->location, "'=' stands for '{}', which is not an instruction or macro of {} arguments",
            target, count == 2 ? "two" : std::to_string(count));
  }
  if (macro == nullptr || preprocessor_.is_expanding(macro)) return std::nullopt;
  const auto punctuator = [&](std::string text) {
    return Token{TokenKind::kPunctuator, equals->location, std::move(text), 0.0};
  };
  Tokens call{{TokenKind::kName, equals->location, target, 0.0}, punctuator("(")};
  std::vector<Tokens> results;
  if (has_result) {
    results.emplace_back(first, equals);
  } else {
    for (Cursor token = first; token != equals; ++token) {
      if (has_targets && token != first) call.push_back(punctuator(","));
      call.push_back(*token);
    }
    if (equals + 1 != last) call.push_back(punctuator(","));
  }
  for (Cursor token = equals + 1; token != last; ++token) {
    if (is_list && token != equals + 1) call.push_back(punctuator(","));
    call.push_back(*token);
  }
  call.push_back(punctuator(")"));
  const Cursor saved_end = std::exchange(end_, call.cend());
  std::optional<Statement> statement = parse_macro_statement(call.cbegin(), call.cend(), std::move(results));
  end_ = saved_end;
  return statement;
}

// A macro call that is the whole line, or the whole right-hand side. The macro's lines follow in the program.
std::optional<Statement> Parser::parse_macro_statement(Cursor first, Cursor last,
                                                       std::vector<Tokens> results) {
  if (first == last || first->kind != TokenKind::kName) return std::nullopt;
  const bool has_parentheses = first + 1 != last;
  if (has_parentheses && (!first[1].is("(") || find_closing_bracket(first + 1) + 1 != last))
    return std::nullopt;
  const auto argument_tokens = has_parentheses ? split_arguments(first + 2, last - 1) : std::vector<Tokens>{};
  const MacroTable::Handle macro =
      preprocessor_.find_macro(first->text, argument_tokens.size(), !results.empty());
  if (macro == nullptr) {
    const MacroTable& macros = preprocessor_.macros();
    const bool is_macro =
        macros.contains(first->text) && (!preprocessor_.is_builtin(first->text) ||
                                         (results.empty() && macros.has_operand_kinds(first->text)));
    if (is_macro && (has_parentheses || results.empty()))
      fail_no_overload(*first, argument_tokens.size(), !results.empty());
    return std::nullopt;
  }
  if (!results.empty() && results.size() != macro->further_results.size() + 1)
    fail_at(first->location, "'{}' gives {} result{}, and {} {} written", first->text,
            macro->further_results.size() + 1, macro->further_results.empty() ? "" : "s", results.size(),
            results.size() == 1 ? "is" : "are");
  check_operands(*first, *macro, argument_tokens);
  std::vector<MacroArgument> arguments = parse_macro_arguments(*first, argument_tokens);
  auto expansion = std::make_shared<MacroExpansion>();
  expansion->macro = macro->name;
  expansion->id =
      sources_.add_expansion(macro->name, first->location, macro->parameters.size(), macro->is_function);
  std::vector<Tokens> replacements =
      bind_arguments(*expansion, *macro, std::move(arguments), first->location);
  for (std::size_t i = 0; i < results.size(); ++i) {
    const std::string& parameter = i == 0 ? macro->result_parameter : macro->further_results[i - 1];
    expansion->arguments.push_back(make_argument(parameter, results[i]));
  }
  Statement statement;
  statement.kind = StatementKind::kMacroBegin;
  statement.location = line_begin_;
  statement.expansion_id = expansion->id;
  statement.expansion = std::move(expansion);
  if (!preprocessor_.enter_macro(macro, statement.expansion_id, std::move(results),
                                 std::move(replacements))) {
    statement.kind = StatementKind::kInvalid;
  }
  return statement;
}

}  // namespace apron::syntax

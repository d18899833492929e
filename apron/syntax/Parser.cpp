#include "apron/syntax/Parser.h"

#include <fmt/format.h>

#include <algorithm>
#include <tuple>
#include <utility>

namespace apron::syntax {
namespace {

Tokens::const_iterator find_equals(Tokens::const_iterator first, Tokens::const_iterator last) {
  int depth = 0;
  return std::find_if(first, last, [&](const Token& token) {
    if (token.is("(") || token.is("[")) ++depth;
    if (token.is(")") || token.is("]")) --depth;
    return depth == 0 && token.is("=");
  });
}

// What to write instead of a line as other languages have it, or "".
std::string advice(const Token& first, const Token& odd) {
  if (odd.is("==")) return "; to give a value, write '='";
  if (odd.is("+") || odd.is("-") || odd.is("*") || odd.is("/")) {
    return fmt::format("; write {0} = {0} {1} …", spell(first), odd.text);
  }
  if (first.is_name("goto")) return fmt::format("; write jump(#{})", spell(odd));
  const bool wants_brackets = first.is_name("if") || first.is_name("while") || first.is_name("for") ||
                              first.is_name("repeat") || first.is_name("where") || first.is_name("print") ||
                              first.is_name("println");
  return wants_brackets ? fmt::format("; write {}(…)", first.text) : "";
}

}  // namespace

Parser::Parser(Preprocessor& preprocessor, Sources& sources, Diagnostics& diagnostics)
    : preprocessor_(preprocessor), sources_(sources), diagnostics_(diagnostics) {}

std::vector<Statement> Parser::parse() {
  std::vector<Statement> program;
  lines(0, program);
  return program;
}

void Parser::lines(std::size_t floor, std::vector<Statement>& out) {
  for (;;) {
    Item item = preprocessor_.next(floor);
    switch (item.kind) {
      case Item::Kind::kDone:
        return;
      case Item::Kind::kLine:
        line(item.line, out);
        break;
      case Item::Kind::kDeclaration:
        declare(std::move(item.declaration), out);
        break;
      case Item::Kind::kLeave:
        out.emplace_back();
        out.back().kind = StatementKind::kLeave;
        out.back().expansion_id = item.expansion;
        break;
    }
  }
}

void Parser::declare(Declaration declaration, std::vector<Statement>& out) const {
  Statement statement;
  statement.kind = StatementKind::kDeclare;
  statement.at = declaration.at;
  statement.declaration = std::make_shared<Declaration>(std::move(declaration));
  out.push_back(std::move(statement));
}

void Parser::line(const Line& line, std::vector<Statement>& out) {
  if (line.bad) return out.push_back(invalid(line));
  const auto outer = std::make_tuple(at_, end_, last_, begin_, depth_);
  begin_ = line.at;
  at_ = line.tokens.begin();
  end_ = line.tokens.end();
  last_ = line.tokens.back().at;
  last_.column += static_cast<std::uint32_t>(spell(line.tokens.back()).size());
  try {
    out.push_back(statement());
  } catch (const Failure& failure) {
    if (!failure.text.empty()) diagnostics_.error(failure.at, failure.text);
    out.push_back(invalid(line));
  }
  std::tie(at_, end_, last_, begin_, depth_) = outer;
}

Statement Parser::invalid(const Line& line) const {
  Statement statement;
  statement.at = line.at;
  statement.target.text = line.tokens.front().text;
  statement.assigns = find_equals(line.tokens.begin(), line.tokens.end()) != line.tokens.end();
  return statement;
}

Statement Parser::statement() {
  const Token& first = *at_;
  Statement result;
  result.at = begin_;
  if (first.kind == TokenKind::kLabel) {
    result.kind = StatementKind::kLabel;
    result.target = make(ExpressionKind::kLabel, first);
    if (++at_ != end_) fail("a label stands alone on its line");
    return result;
  }
  const Cursor equals = find_equals(at_, end_);
  if (equals != end_) return assignment(equals);
  if (first.kind == TokenKind::kParameter || first.kind == TokenKind::kLocal) whole(at_, end_, last_);
  if (first.kind != TokenKind::kName) fail(fmt::format("a line cannot begin with '{}'", spell(first)));
  if (auto macro = macro_statement(at_, end_, {})) return std::move(*macro);
  const bool is_call = at_ + 1 == end_ || (at_[1].is("(") && closing(at_ + 1) + 1 == end_);
  if (!is_call) {
    const Cursor odd = at_[1].is("(") ? closing(at_ + 1) + 1 : at_ + 1;
    at_ = odd;
    fail(fmt::format("expected '=' or the end of the line, not '{}'{}", spell(*odd), advice(first, *odd)));
  }
  result.kind = StatementKind::kCall;
  if (at_ + 1 == end_) {
    result.value = make(ExpressionKind::kName, first);
  } else {
    ++at_;
    result.value = call(first);
  }
  return result;
}

Statement Parser::assignment(Cursor equals) {
  const Cursor first = at_;
  const Cursor last = end_;
  if (equals == first) fail("expected a name before '='");
  const bool updates = equals - first > 1 && equals[-1].kind == TokenKind::kSymbol &&
                       equals[-1].at.line == equals->at.line && equals[-1].text.find_first_of("+-*/%") == 0;
  if (updates) {
    throw Failure{equals[-1].at,
                  fmt::format("there is no '{0}='; write {1} = {1} {0} …", equals[-1].text, spell(*first))};
  }
  if (auto macro = macro_statement(equals + 1, last, Tokens(first, equals))) return std::move(*macro);
  Statement result;
  result.kind = StatementKind::kAssign;
  result.at = begin_;
  result.target = whole(first, equals, equals->at);
  const ExpressionKind kind = result.target.kind;
  if (kind != ExpressionKind::kName && kind != ExpressionKind::kElement) {
    throw Failure{first->at, "only a register, an element or a scalar can stand before '='"};
  }
  if (equals + 1 == last) throw Failure{last_, "expected a value after '='"};
  result.value = whole(equals + 1, last, last_);
  return result;
}

// A macro call that is the whole line, or all that stands right of '='. Its lines follow in the program.
std::optional<Statement> Parser::macro_statement(Cursor first, Cursor last, Tokens result) {
  if (first == last || first->kind != TokenKind::kName) return std::nullopt;
  const bool brackets = first + 1 != last;
  if (brackets && (!first[1].is("(") || closing(first + 1) + 1 != last)) return std::nullopt;
  const auto words = brackets ? split_arguments(first + 2, last - 1) : std::vector<Tokens>{};
  const MacroTable::Handle macro = preprocessor_.find(first->text, words.size(), !result.empty());
  if (macro == nullptr) {
    const bool ours = preprocessor_.macros().has(first->text) && !preprocessor_.is_builtin(first->text);
    if (ours && (brackets || result.empty())) no_overload(*first, words.size(), !result.empty());
    return std::nullopt;
  }
  std::vector<Argument> arguments = read_arguments(*first, words);
  auto expansion = std::make_shared<MacroExpansion>();
  expansion->macro = macro->name;
  expansion->id = sources_.add_expansion(macro->name, first->at);
  std::vector<Tokens> places = bind(*expansion, *macro, std::move(arguments), first->at);
  Statement statement;
  statement.kind = StatementKind::kEnter;
  statement.at = begin_;
  statement.expansion_id = expansion->id;
  statement.expansion = std::move(expansion);
  if (!preprocessor_.enter(macro, statement.expansion_id, std::move(result), std::move(places))) {
    statement.kind = StatementKind::kInvalid;
  }
  return statement;
}

}  // namespace apron::syntax

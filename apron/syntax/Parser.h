// Lines to statements. Opens macro calls, in statements and inside expressions.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "apron/syntax/Ast.h"
#include "apron/syntax/Diagnostic.h"
#include "apron/syntax/Preprocessor.h"
#include "apron/syntax/Token.h"

namespace apron::syntax {

class Parser {
 public:
  Parser(Preprocessor&, Sources&, Diagnostics&);

  // The whole program. A line with an error becomes kInvalid and the next goes on.
  std::vector<Statement> parse();

 private:
  using Cursor = Tokens::const_iterator;
  struct Failure {
    Location at;
    std::string text;
  };
  struct Argument {
    Tokens words;
    std::optional<Expression> value;
  };
  class Nested;

  void lines(std::size_t floor, std::vector<Statement>& out);
  void line(const Line&, std::vector<Statement>& out);
  Statement statement();
  Statement assignment(Cursor equals);
  Statement invalid(const Line&) const;
  std::optional<Statement> macro_statement(Cursor first, Cursor last, Tokens result);
  void declare(Declaration, std::vector<Statement>& out) const;

  // ParseExpression.cpp
  Expression whole(Cursor first, Cursor last, Location end_at);
  Expression binary(int level);
  Expression prefix_not();
  Expression unary();
  Expression primary();
  Expression name();
  Expression call(const Token& name);
  Expression element(const Token& name);
  Expression argument();
  Expression module();
  Expression combine(const Token& op, Expression left, Expression right);
  Expression expand(const MacroTable::Handle&, const Token& call, std::vector<Argument>);
  std::vector<Argument> read_arguments(const Token& call, const std::vector<Tokens>&);
  std::vector<Tokens> bind(MacroExpansion&, const Macro&, std::vector<Argument>, Location at);
  [[noreturn]] void no_overload(const Token& call, std::size_t arguments, bool result) const;
  Cursor closing(Cursor open) const;

  Expression make(ExpressionKind, const Token&, std::vector<Expression> children = {}) const;
  bool take(std::string_view symbol);
  bool at_end() const { return at_ == end_; }
  Location here() const;
  [[noreturn]] void fail(std::string text) const;

  Preprocessor& preprocessor_;
  Sources& sources_;
  Diagnostics& diagnostics_;
  Cursor at_, end_;
  Location begin_, last_;  // where the line begins and ends
  std::size_t depth_ = 0;
};

}  // namespace apron::syntax

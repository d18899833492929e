// Parses lines into statements. Expands macro calls in statements and expressions.
#pragma once

#include <fmt/format.h>

#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "apron/syntax/Ast.h"
#include "apron/syntax/Diagnostic.h"
#include "apron/syntax/Preprocessor.h"
#include "apron/syntax/Token.h"

namespace apron::syntax {

class Parser {
 public:
  Parser(Preprocessor&, SourceManager&, Diagnostics&);

  // The whole program. A line with an error becomes kInvalid, and parsing continues with the next.
  std::vector<Statement> parse();

 private:
  using Cursor = Tokens::const_iterator;
  struct SyntaxError {
    Location location;
    std::string message;
  };
  // Thrown for a line whose error the preprocessor has reported.
  struct AlreadyReported {};
  struct MacroArgument {
    Tokens tokens;
    std::optional<Expression> value;
  };
  class DepthGuard;

  void parse_lines(std::size_t min_depth, std::vector<Statement>& out);
  void parse_line(const Line&, std::vector<Statement>& out);
  Statement parse_statement();
  Statement parse_assignment(Cursor equals);
  Statement make_invalid(const Line&) const;
  std::optional<Statement> parse_rebound_assignment(Cursor first, Cursor equals, Cursor last);
  std::optional<Statement> parse_macro_statement(Cursor first, Cursor last, std::vector<Tokens> results);
  void add_declaration(Declaration, std::vector<Statement>& out) const;

  // ParseExpression.cpp
  Expression parse_range(Cursor first, Cursor last, Location end_location);
  Expression parse_binary(int level);
  bool begins_operand(Cursor first) const;
  bool is_negation_operator() const;
  Expression parse_not(int level);
  Expression parse_unary();
  Expression parse_primary();
  Expression parse_name();
  Expression parse_call(const Token& name);
  Expression parse_element(const Token& name);
  void check_negation(const Token& name) const;
  Expression parse_argument();
  Expression parse_module();
  Expression make_binary(const Token& op, Expression left, Expression right);
  Expression expand_macro(const MacroTable::Handle&, const Token& call, std::vector<MacroArgument>);
  bool mentions_rebound(const Tokens&) const;
  std::vector<MacroArgument> parse_macro_arguments(const Token& call, const std::vector<Tokens>&);
  std::vector<Tokens> bind_arguments(MacroExpansion&, const Macro&, std::vector<MacroArgument>,
                                     Location location);
  Argument make_argument(const std::string& parameter, const Tokens&) const;
  void check_integer(const MacroParameter&, const Macro&, MacroArgument&, Location);
  void check_operands(const Token& call, const Macro&, const std::vector<Tokens>& operands) const;
  std::string too_deep() const;
  void check_depth(const Expression&) const;  // the message
  [[noreturn]] void fail_no_overload(const Token& call, std::size_t arguments, bool result) const;
  Cursor find_closing_bracket(Cursor open) const;

  Expression make_expression(ExpressionKind, const Token&, std::vector<Expression> children = {}) const;
  bool consume(std::string_view symbol);
  bool at_end() const { return cursor_ == end_; }
  Location current_location() const;
  // Throws a SyntaxError at the current token, or at a location.
  template <class... Arguments>
  [[noreturn]] void fail(fmt::format_string<Arguments...> message, Arguments&&... arguments) const {
    fail_at(current_location(), message, std::forward<Arguments>(arguments)...);
  }
  template <class... Arguments>
  [[noreturn]] static void fail_at(Location location, fmt::format_string<Arguments...> message,
                                   Arguments&&... arguments) {
    throw SyntaxError{location, fmt::format(message, std::forward<Arguments>(arguments)...)};
  }

  Preprocessor& preprocessor_;
  SourceManager& sources_;
  Diagnostics& diagnostics_;
  Cursor cursor_, end_;
  Location line_begin_, line_end_;  // where the line begins and ends
  std::size_t depth_ = 0;
};

}  // namespace apron::syntax

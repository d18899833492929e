// Tokens, and lines of tokens: one statement or directive per line.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "apron/syntax/SourceManager.h"

namespace apron::syntax {

enum class TokenKind : std::uint8_t {
  kName,        // letters, digits, _ and dots
  kNumber,      // value in `number`
  kString,      // 'text', without the quotes
  kParameter,   // $name in a macro
  kLocalName,   // :name in a macro
  kLabel,       // #name
  kLocalLabel,  // :#name in a macro
  kDirective,   // !name at the start of a line
  kPunctuator,  // operators and punctuation
};

struct Token {
  TokenKind kind = TokenKind::kPunctuator;
  Location location;
  std::string text;  // of a name, text or symbol; without the sigil of the others
  double number = 0.0;
  bool no_expand = false;   // a name that resulted from its own define is not expanded again
  std::uint32_t owner = 0;  // of a macro's local name: the number of the expansion that it belongs to
  // Where a body writes the parameter or the local name that this token replaces; line 0 if it replaces none.
  Location parameter = {};

  bool is(std::string_view symbol) const { return kind == TokenKind::kPunctuator && text == symbol; }
  bool is_name(std::string_view name) const { return kind == TokenKind::kName && text == name; }
};

using Tokens = std::vector<Token>;

// Where the token stands in its line, be it replaced or not.
inline const Location& place(const Token& token) {
  return token.parameter.line != 0 ? token.parameter : token.location;
}

struct Line {
  Location location;       // of its first token in the source, before replacement
  Tokens tokens;           // never empty
  bool has_error = false;  // already reported; the tokens end before the error
  Location end = {};       // behind its last token, of one that is being parsed
};

// The `=` of an assignment, outside brackets; `last` if there is none.
Tokens::const_iterator find_equals(Tokens::const_iterator first, Tokens::const_iterator last);

// The ranges between commas outside brackets; none for an empty list.
std::vector<Tokens> split_arguments(Tokens::const_iterator first, Tokens::const_iterator last);

// The token as the source writes it.
std::string spelling(const Token&);

// True for the words of control flow and logic, which name nothing else.
bool is_keyword(std::string_view name);

// The precedence of an infix operator, from 1, the loosest; 0 of any other token.
int infix_precedence(const Token&);
inline constexpr int kNotPrecedence = 4;  // of the prefix `not`
inline constexpr int kComparisonPrecedence = 5;
inline constexpr int kTightest = 12;  // beyond the infix operators

// Removes the number of the expansion, which makes local names unique: "t:7" of a macro becomes ":t", "$a:7"
// "$a", and "t::7" of a function "t".
std::string display_name(const std::string& name);
// True for a function's local name.
inline bool is_function_local(std::string_view name) { return name.find("::") != std::string_view::npos; }

}  // namespace apron::syntax

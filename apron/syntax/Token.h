// The words of the language and the lines they make: one statement or directive a line.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "apron/syntax/Sources.h"

namespace apron::syntax {

enum class TokenKind : std::uint8_t {
  kName,        // letters, digits, _ and dots
  kNumber,      // value in `number`
  kText,        // 'text', without the quotes
  kParameter,   // $name in a macro
  kLocal,       // :name in a macro
  kLabel,       // #name
  kLocalLabel,  // :#name in a macro
  kDirective,   // !name at the start of a line
  kSymbol,      // operators and punctuation
};

struct Token {
  TokenKind kind = TokenKind::kSymbol;
  Location at;
  std::string text;  // of a name, text or symbol; without the sigil of the others
  float number = 0.0F;
  bool done = false;  // a name that came out of its own define, which does not replace it again

  bool is(std::string_view symbol) const { return kind == TokenKind::kSymbol && text == symbol; }
  bool is_name(std::string_view name) const { return kind == TokenKind::kName && text == name; }
};

using Tokens = std::vector<Token>;

struct Line {
  Location at;       // where it begins in its text, whatever takes its words' places
  Tokens tokens;     // never empty
  bool bad = false;  // reported already; the tokens end where the trouble began
};

// As the user would write it.
std::string spell(const Token&);

// A macro's own names carry the expansion's number to be unique: "t:7" is ":t" to the user, "$a:7" is "$a".
std::string written(const std::string& name);

}  // namespace apron::syntax

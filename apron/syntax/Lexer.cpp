#include "apron/syntax/Lexer.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <string_view>
#include <system_error>
#include <utility>

#include "common/text/Utf8.h"

namespace apron::syntax {
namespace {

bool is_digit(char c) { return c >= '0' && c <= '9'; }
bool is_letter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_'; }
bool is_hex_digit(char c) { return is_digit(c) || (c >= 'a' && c <= 'f') || (c >= 'A' && c <= 'F'); }

// Names may contain letters of any alphabet, but no look-alikes of spaces and operators.
bool is_foreign_letter(std::uint32_t code) {
  const bool blank_or_sign = code < 0xC0 || code == 0xD7 || code == 0xF7 ||
                             (code >= 0x2000 && code <= 0x2BFF) || (code >= 0x3000 && code <= 0x3020) ||
                             (code >= 0xFE00 && code <= 0xFE0F) || (code >= 0xFF00 && code <= 0xFF20) ||
                             code == 0xFEFF || code >= 0xE0000;
  return !blank_or_sign;
}

// How APRON writes an operator of other languages.
std::string_view foreign_syntax_hint(char c) {
  switch (c) {
    case ';':
      return ": a statement ends with its line";
    case '{':
    case '}':
      return ": blocks end with a word, as in if(…) … endif";
    default:
      return "";
  }
}

class Lexer {
 public:
  Lexer(const SourceManager& sources, std::uint32_t file, Diagnostics& diagnostics)
      : text_(sources.file(file).text), file_(file), diagnostics_(diagnostics) {}

  std::vector<Line> lex() {
    if (text_.starts_with(common::kByteOrderMark)) position_ = common::kByteOrderMark.size();
    while (position_ < text_.size() && !diagnostics_.full()) lex_next();
    finish_line();
    return std::move(lines_);
  }

 private:
  char peek(std::size_t ahead = 0) const {
    return position_ + ahead < text_.size() ? text_[position_ + ahead] : '\0';
  }
  Location current_location() const { return {file_, line_, column_, 0}; }

  void advance(std::size_t bytes) {
    position_ += bytes;
    column_ += static_cast<std::uint32_t>(bytes);
  }

  void advance_line() {
    ++position_;
    ++line_;
    column_ = 1;
  }

  void finish_line() {
    if (!tokens_.empty()) lines_.push_back({tokens_.front().location, std::move(tokens_), line_has_error_});
    tokens_.clear();
    line_has_error_ = false;
  }

  template <class... Arguments>
  void report_error(Location location, fmt::format_string<Arguments...> message, Arguments&&... arguments) {
    if (!line_has_error_)
      diagnostics_.error(location, fmt::format(message, std::forward<Arguments>(arguments)...));
    line_has_error_ = true;
  }

  void add_token(TokenKind kind, Location location, std::string text, double number = 0.0) {
    if (!line_has_error_) tokens_.push_back({kind, location, std::move(text), number});
  }

  bool at_line_end() const {
    return peek() == '\n' || (peek() == '\r' && peek(1) == '\n') || position_ >= text_.size();
  }

  void lex_next() {
    const char c = peek();
    if (c == '\n') {
      finish_line();
      advance_line();
    } else if (c == ' ' || c == '\t' || c == '\r') {
      advance(1);
    } else if (c == '/' && peek(1) == '/') {
      skip_comment();
    } else if (c == '\\') {
      lex_continuation();
    } else {
      lex_token();
    }
  }

  void skip_comment() { position_ = std::min(text_.find('\n', position_), text_.size()); }

  void lex_continuation() {
    const Location location = current_location();
    advance(1);
    while (peek() == ' ' || peek() == '\t') advance(1);
    if (peek() == '/' && peek(1) == '/') skip_comment();
    if (!at_line_end())
      return report_error(location, "a '\\' may only end a line, to continue it on the next");
    if (peek() == '\r') ++position_;
    if (peek() == '\n') advance_line();
  }

  void lex_token() {
    const char c = peek();
    const Location location = current_location();
    if (is_digit(c) || (c == '.' && is_digit(peek(1)))) return lex_number();
    if (is_letter(c) || at_foreign_letter()) return add_token(TokenKind::kName, location, lex_name());
    if (c == '\'') return lex_string();
    if (c == '#' && peek(1) == '#') return lex_punctuator();
    if (c == '$' || c == '#' || c == ':') return lex_sigil(c);
    if (c == '!' && tokens_.empty() && is_letter(peek(1))) {
      advance(1);
      return add_token(TokenKind::kDirective, location, lex_name());
    }
    lex_punctuator();
  }

  bool at_foreign_letter() const {
    if (static_cast<unsigned char>(peek()) < 0x80) return false;
    const common::CodePoint c = common::decode_utf8(text_.substr(position_));
    return c.bytes > 0 && is_foreign_letter(c.code);
  }

  std::string lex_name() {
    const std::size_t first = position_;
    for (;;) {
      if (is_letter(peek()) || is_digit(peek()) || peek() == '.') {
        advance(1);
      } else if (position_ < text_.size() && at_foreign_letter()) {
        position_ += common::decode_utf8(text_.substr(position_)).bytes;
        ++column_;
      } else {
        return std::string(text_.substr(first, position_ - first));
      }
    }
  }

  void lex_sigil(char c) {
    const Location location = current_location();
    advance(1);
    TokenKind kind = c == '$' ? TokenKind::kParameter : c == '#' ? TokenKind::kLabel : TokenKind::kLocalName;
    if (c == ':' && peek() == '#') {
      advance(1);
      kind = TokenKind::kLocalLabel;
    }
    std::string text = lex_name();
    if (text.empty()) {
      return report_error(location, "expected a name after '{}'{}", c,
                          c == '#'   ? "; a comment begins with '//'"
                          : c == ':' ? "; 'a ? b : c' is select(a, b, c)"
                                     : "");
    }
    add_token(kind, location, std::move(text));
  }

  void lex_string() {
    const Location location = current_location();
    advance(1);
    std::string text;
    while (peek() != '\'') {
      if (at_line_end()) return report_error(location, "this text has no closing quote");
      const common::CodePoint c = common::decode_utf8(text_.substr(position_));
      if (c.bytes == 0 || (c.code < 0x20 && c.code != '\t')) {
        report_error(current_location(), "this text holds a byte that is not printable UTF-8");
        return advance(1);
      }
      text += text_.substr(position_, c.bytes);
      position_ += c.bytes;
      ++column_;
    }
    advance(1);
    add_token(TokenKind::kString, location, std::move(text));
  }

  void lex_number() {
    const Location location = current_location();
    const std::size_t first = position_;
    if (peek() == '0' && (peek(1) == 'x' || peek(1) == 'X')) {
      advance(2);
      while (is_hex_digit(peek())) advance(1);
    } else {
      while (is_digit(peek())) advance(1);
      if (peek() == '.') advance(1);
      while (is_digit(peek())) advance(1);
      const bool sign = peek(1) == '+' || peek(1) == '-';
      if ((peek() == 'e' || peek() == 'E') && is_digit(peek(sign ? 2 : 1))) {
        advance(sign ? 2 : 1);
        while (is_digit(peek())) advance(1);
      }
    }
    std::string_view digits = text_.substr(first, position_ - first);
    if (peek() == 'f' || peek() == 'F') advance(1);
    if (is_letter(peek()) || is_digit(peek()) || peek() == '.') {
      lex_name();
      return report_error(location, "'{}' is not a number", text_.substr(first, position_ - first));
    }
    add_number(location, digits);
  }

  void add_number(Location location, std::string_view digits) {
    const bool hex = digits.size() > 1 && (digits[1] == 'x' || digits[1] == 'X');
    const auto parse = [&](auto& value) {
      return std::from_chars(digits.data() + (hex ? 2 : 0), digits.data() + digits.size(), value,
                             hex ? std::chars_format::hex : std::chars_format::general)
          .ec;
    };
    float value = 0.0F;
    std::errc error = parse(value);
    // Underflow is reported as out of range too; the value is zero.
    if (error == std::errc::result_out_of_range && !hex) {
      double wide = 0.0;
      const auto retry_error = parse(wide);
      const bool tiny = retry_error == std::errc{} ? std::fabs(wide) < 1.0 : is_tiny(digits);
      if (tiny) {
        value = retry_error == std::errc{} ? static_cast<float>(wide) : 0.0F;
        error = {};
      }
    }
    if (error == std::errc::result_out_of_range) {
      return report_error(location, "the number {} does not fit 32-bit floating point", digits);
    }
    if (error != std::errc{}) return report_error(location, "'{}' is not a number", digits);
    // Whole numbers are exact; a register's cell rounds them to its 32 bits.
    double whole = 0.0;
    if (parse(whole) != std::errc{}) whole = value;
    add_token(TokenKind::kNumber, location, std::string(digits), is_exact_whole(whole) ? whole : value);
  }

  static bool is_exact_whole(double value) {
    return std::fabs(value) <= 9007199254740992.0 && value == std::trunc(value);  // 2^53
  }

  static bool is_tiny(std::string_view digits) {
    return digits.find("e-") != digits.npos || digits.find("E-") != digits.npos;
  }

  void lex_punctuator() {
    const Location location = current_location();
    const std::string_view punctuator = text_.substr(position_, punctuator_length(text_.substr(position_)));
    if (punctuator.empty()) return report_unexpected(location);
    advance(punctuator.size());
    add_token(TokenKind::kPunctuator, location, std::string(punctuator));
  }

  void report_unexpected(Location location) {
    const common::CodePoint c = common::decode_utf8(text_.substr(position_));
    if (c.bytes == 0) {
      report_error(location, "this byte is not UTF-8");
    } else if (c.code == '"') {
      report_error(location, "texts stand in single quotes: 'text'");
    } else if (c.code < 0x20 || c.code == 0x7F) {
      report_error(location, "unexpected control character U+{:04X}", c.code);
    } else if (c.code < 0x80) {
      report_error(location, "unexpected character '{}'{}", peek(), foreign_syntax_hint(peek()));
    } else {
      report_error(location, "unexpected character '{}' (U+{:04X})", text_.substr(position_, c.bytes),
                   c.code);
    }
    position_ += c.bytes > 0 ? c.bytes : 1;
    ++column_;
  }

  std::string_view text_;
  std::uint32_t file_;
  Diagnostics& diagnostics_;
  std::size_t position_ = 0;
  std::uint32_t line_ = 1, column_ = 1;
  Tokens tokens_;
  std::vector<Line> lines_;
  bool line_has_error_ = false;  // an error was found in the line
};

}  // namespace

std::size_t punctuator_length(std::string_view text) noexcept {
  static constexpr std::string_view kPairs[] = {"<=", ">=", "==", "!=", "&&", "||", "<<", ">>", "##"};
  static constexpr std::string_view kSingles = "+-*/%<>=()[],!?&|^~";
  if (text.empty()) return 0;
  if (std::ranges::find(kPairs, text.substr(0, 2)) != std::end(kPairs)) return 2;
  return kSingles.find(text.front()) != kSingles.npos ? 1 : 0;
}

bool is_keyword(std::string_view name) {
  static constexpr std::string_view kKeywords[] = {
      "if",       "else",        "endif",  "while",     "endwhile", "for",   "endfor",
      "repeat",   "endrepeat",   "where",  "elsewhere", "endwhere", "break", "continue",
      "function", "endfunction", "return", "jump",      "jumpif",   "call",  "callif",
      "end",      "and",         "or",     "xor",       "nand",     "nor",   "not"};
  return std::ranges::find(kKeywords, name) != std::end(kKeywords);
}

int infix_precedence(const Token& token) {
  static constexpr std::pair<std::string_view, int> kWords[] = {
      {"or", 1}, {"nor", 1}, {"xor", 2}, {"and", 3}, {"nand", 3}};
  static constexpr std::pair<std::string_view, int> kSymbols[] = {
      {"||", 1}, {"&&", 3}, {"<", 5},  {"<=", 5}, {">", 5},  {">=", 5}, {"==", 5}, {"!=", 5}, {"|", 6},
      {"^", 7},  {"&", 8},  {"<<", 9}, {">>", 9}, {"+", 10}, {"-", 10}, {"*", 11}, {"/", 11}, {"%", 11}};
  if (token.kind == TokenKind::kName) {
    for (const auto& [text, level] : kWords) {
      if (token.text == text) return level;
    }
  } else if (token.kind == TokenKind::kPunctuator) {
    for (const auto& [text, level] : kSymbols) {
      if (token.text == text) return level;
    }
  }
  return 0;
}

std::vector<Tokens> split_arguments(Tokens::const_iterator first, Tokens::const_iterator last) {
  std::vector<Tokens> list;
  if (first == last) return list;
  list.emplace_back();
  int depth = 0;
  for (; first != last; ++first) {
    if (first->is("(") || first->is("[")) ++depth;
    if (first->is(")") || first->is("]")) --depth;
    if (depth == 0 && first->is(",")) {
      list.emplace_back();
    } else {
      list.back().push_back(*first);
    }
  }
  return list;
}

Tokens::const_iterator find_equals(Tokens::const_iterator first, Tokens::const_iterator last) {
  int depth = 0;
  return std::find_if(first, last, [&](const Token& token) {
    if (token.is("(") || token.is("[")) ++depth;
    if (token.is(")") || token.is("]")) --depth;
    return depth == 0 && token.is("=");
  });
}

std::string spelling(const Token& token) {
  switch (token.kind) {
    case TokenKind::kString:
      return fmt::format("'{}'", token.text);
    case TokenKind::kParameter:
      return fmt::format("${}", token.text);
    case TokenKind::kLocalName:
      return fmt::format(":{}", token.text);
    case TokenKind::kLabel:
      return fmt::format("#{}", token.text);
    case TokenKind::kLocalLabel:
      return fmt::format(":#{}", token.text);
    case TokenKind::kDirective:
      return fmt::format("!{}", token.text);
    case TokenKind::kName:
      return display_name(token.text);
    default:
      return token.text;
  }
}

std::string display_name(const std::string& name) {
  const std::size_t colon = name.find(':');
  if (colon == std::string::npos) return name;
  const bool is_parameter = name.front() == '$';
  if (is_function_local(name)) return name.substr(is_parameter ? 1 : 0, colon - (is_parameter ? 1 : 0));
  return (is_parameter ? "" : ":") + name.substr(0, colon);
}

std::vector<Line> lex(const SourceManager& sources, std::uint32_t file, Diagnostics& diagnostics) {
  if (sources.file(file).text.size() > kMaxFileBytes) {
    diagnostics.error({file, 0, 0, 0}, fmt::format("the file is larger than {} bytes", kMaxFileBytes));
    return {};
  }
  return Lexer(sources, file, diagnostics).lex();
}

}  // namespace apron::syntax

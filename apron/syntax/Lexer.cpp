#include "apron/syntax/Lexer.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <cstdint>
#include <string_view>
#include <system_error>
#include <utility>

namespace apron::syntax {
namespace {

bool is_digit(char c) { return c >= '0' && c <= '9'; }
bool is_letter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_'; }
bool is_hex(char c) { return is_digit(c) || (c >= 'a' && c <= 'f') || (c >= 'A' && c <= 'F'); }

struct Character {
  std::uint32_t code = 0;
  std::size_t bytes = 0;  // 0: not UTF-8
};

Character decode(std::string_view text) {
  const auto byte = [&](std::size_t i) {
    return static_cast<std::uint32_t>(static_cast<unsigned char>(text[i]));
  };
  const std::uint32_t lead = byte(0);
  if (lead < 0x80) return {lead, 1};
  const std::size_t bytes = lead >= 0xF0 ? 4 : lead >= 0xE0 ? 3 : 2;
  if (lead < 0xC2 || lead > 0xF4 || text.size() < bytes) return {};
  std::uint32_t code = lead & (0xFFU >> (bytes + 1));
  for (std::size_t i = 1; i < bytes; ++i) {
    if ((byte(i) & 0xC0U) != 0x80U) return {};
    code = (code << 6U) | (byte(i) & 0x3FU);
  }
  const bool overlong = (bytes == 3 && code < 0x800) || (bytes == 4 && code < 0x10000);
  const bool surrogate = code >= 0xD800 && code <= 0xDFFF;
  return overlong || surrogate || code > 0x10FFFF ? Character{} : Character{code, bytes};
}

// Letters of other alphabets may stand in names; look-alikes of blanks and operators may not.
bool is_foreign_letter(std::uint32_t code) {
  const bool blank_or_sign = code < 0xC0 || code == 0xD7 || code == 0xF7 ||
                             (code >= 0x2000 && code <= 0x2BFF) || (code >= 0x3000 && code <= 0x3020) ||
                             (code >= 0xFE00 && code <= 0xFE0F) || (code >= 0xFF00 && code <= 0xFF20) ||
                             code == 0xFEFF || code >= 0xE0000;
  return !blank_or_sign;
}

// What to write for a sign of other languages.
std::string_view foreign_sign(char c) {
  switch (c) {
    case ';':
      return ": a statement ends with its line";
    case '{':
    case '}':
      return ": blocks end with a word, as in if(…) … endif";
    case '^':
      return ": a power is pow(a, b), an exclusive or is 'xor'";
    case '&':
      return ": write 'and'";
    case '|':
      return ": write 'or'";
    default:
      return "";
  }
}

class Lexer {
 public:
  Lexer(const Sources& sources, std::uint32_t file, Diagnostics& diagnostics)
      : text_(sources.file(file).text), file_(file), diagnostics_(diagnostics) {}

  std::vector<Line> run() {
    if (text_.substr(0, 3) == "\xEF\xBB\xBF") at_ = 3;
    while (at_ < text_.size() && !diagnostics_.full()) step();
    finish_line();
    return std::move(lines_);
  }

 private:
  char peek(std::size_t ahead = 0) const { return at_ + ahead < text_.size() ? text_[at_ + ahead] : '\0'; }
  Location here() const { return {file_, line_, column_, 0}; }

  void skip(std::size_t bytes) {
    at_ += bytes;
    column_ += static_cast<std::uint32_t>(bytes);
  }

  void next_line() {
    ++at_;
    ++line_;
    column_ = 1;
  }

  void finish_line() {
    if (!tokens_.empty()) lines_.push_back({tokens_.front().at, std::move(tokens_), bad_});
    tokens_.clear();
    bad_ = false;
  }

  void fail(Location at, std::string text) {
    if (!bad_) diagnostics_.error(at, std::move(text));
    bad_ = true;
  }

  void add(TokenKind kind, Location at, std::string text, float number = 0.0F) {
    if (!bad_) tokens_.push_back({kind, at, std::move(text), number});
  }

  bool at_line_end() const {
    return peek() == '\n' || (peek() == '\r' && peek(1) == '\n') || at_ >= text_.size();
  }

  void step() {
    const char c = peek();
    if (c == '\n') {
      finish_line();
      next_line();
    } else if (c == ' ' || c == '\t' || c == '\r') {
      skip(1);
    } else if (c == '/' && peek(1) == '/') {
      while (at_ < text_.size() && peek() != '\n') ++at_;
    } else if (c == '\\') {
      continuation();
    } else {
      token();
    }
  }

  void continuation() {
    const Location at = here();
    skip(1);
    while (peek() == ' ' || peek() == '\t') skip(1);
    if (peek() == '/' && peek(1) == '/') {
      while (at_ < text_.size() && peek() != '\n') ++at_;
    }
    if (!at_line_end()) return fail(at, "a '\\' may only end a line, to continue it on the next");
    if (peek() == '\r') ++at_;
    if (peek() == '\n') next_line();
  }

  void token() {
    const char c = peek();
    const Location at = here();
    if (is_digit(c) || (c == '.' && is_digit(peek(1)))) return number();
    if (is_letter(c) || starts_foreign_name()) return add(TokenKind::kName, at, name());
    if (c == '\'') return quoted();
    if (c == '$' || c == '#' || c == ':') return sigil(c);
    if (c == '!' && tokens_.empty() && is_letter(peek(1))) {
      skip(1);
      return add(TokenKind::kDirective, at, name());
    }
    symbol();
  }

  bool starts_foreign_name() const {
    if (static_cast<unsigned char>(peek()) < 0x80) return false;
    const Character c = decode(text_.substr(at_));
    return c.bytes > 0 && is_foreign_letter(c.code);
  }

  std::string name() {
    const std::size_t first = at_;
    for (;;) {
      if (is_letter(peek()) || is_digit(peek()) || peek() == '.') {
        skip(1);
      } else if (at_ < text_.size() && starts_foreign_name()) {
        at_ += decode(text_.substr(at_)).bytes;
        ++column_;
      } else {
        return std::string(text_.substr(first, at_ - first));
      }
    }
  }

  void sigil(char c) {
    const Location at = here();
    skip(1);
    TokenKind kind = c == '$' ? TokenKind::kParameter : c == '#' ? TokenKind::kLabel : TokenKind::kLocal;
    if (c == ':' && peek() == '#') {
      skip(1);
      kind = TokenKind::kLocalLabel;
    }
    std::string text = name();
    if (text.empty()) {
      return fail(
          at, fmt::format("expected a name after '{}'{}", c, c == '#' ? "; a comment begins with '//'" : ""));
    }
    add(kind, at, std::move(text));
  }

  void quoted() {
    const Location at = here();
    skip(1);
    std::string text;
    while (peek() != '\'') {
      if (at_line_end()) return fail(at, "this text has no closing quote");
      const Character c = decode(text_.substr(at_));
      if (c.bytes == 0 || (c.code < 0x20 && c.code != '\t')) {
        fail(here(), "this text holds a byte that is not printable UTF-8");
        return skip(1);
      }
      text += text_.substr(at_, c.bytes);
      at_ += c.bytes;
      ++column_;
    }
    skip(1);
    add(TokenKind::kText, at, std::move(text));
  }

  void number() {
    const Location at = here();
    const std::size_t first = at_;
    if (peek() == '0' && (peek(1) == 'x' || peek(1) == 'X')) {
      skip(2);
      while (is_hex(peek())) skip(1);
    } else {
      while (is_digit(peek())) skip(1);
      if (peek() == '.') skip(1);
      while (is_digit(peek())) skip(1);
      const bool sign = peek(1) == '+' || peek(1) == '-';
      if ((peek() == 'e' || peek() == 'E') && is_digit(peek(sign ? 2 : 1))) {
        skip(sign ? 2 : 1);
        while (is_digit(peek())) skip(1);
      }
    }
    std::string_view digits = text_.substr(first, at_ - first);
    if (peek() == 'f' || peek() == 'F') skip(1);
    if (is_letter(peek()) || is_digit(peek()) || peek() == '.') {
      name();
      return fail(at, fmt::format("'{}' is not a number", text_.substr(first, at_ - first)));
    }
    convert(at, digits);
  }

  void convert(Location at, std::string_view digits) {
    const bool hex = digits.size() > 1 && (digits[1] == 'x' || digits[1] == 'X');
    float value = 0.0F;
    std::errc error{};
    if (hex) {
      std::uint64_t whole = 0;
      error = std::from_chars(digits.data() + 2, digits.data() + digits.size(), whole, 16).ec;
      value = static_cast<float>(whole);
    } else {
      error = std::from_chars(digits.data(), digits.data() + digits.size(), value).ec;
      // Too small for a float reads as out of range too; it is zero.
      if (error == std::errc::result_out_of_range) {
        double wide = 0.0;
        const auto again = std::from_chars(digits.data(), digits.data() + digits.size(), wide).ec;
        const bool tiny = again == std::errc{} ? std::fabs(wide) < 1.0 : is_tiny(digits);
        if (tiny) {
          value = again == std::errc{} ? static_cast<float>(wide) : 0.0F;
          error = {};
        }
      }
    }
    if (error == std::errc::result_out_of_range) {
      return fail(at, fmt::format("the number {} does not fit 32-bit floating point", digits));
    }
    if (error != std::errc{}) return fail(at, fmt::format("'{}' is not a number", digits));
    add(TokenKind::kNumber, at, std::string(digits), value);
  }

  static bool is_tiny(std::string_view digits) {
    return digits.find("e-") != digits.npos || digits.find("E-") != digits.npos;
  }

  void symbol() {
    static constexpr std::string_view kPairs[] = {"<=", ">=", "==", "!=", "&&", "||"};
    static constexpr std::string_view kSingles = "+-*/%<>=()[],!?";
    const Location at = here();
    for (const std::string_view pair : kPairs) {
      if (text_.substr(at_, 2) == pair) {
        skip(2);
        return add(TokenKind::kSymbol, at, std::string(pair));
      }
    }
    const char c = peek();
    if (kSingles.find(c) != kSingles.npos && c != '\0') {
      skip(1);
      return add(TokenKind::kSymbol, at, std::string(1, c));
    }
    unexpected(at);
  }

  void unexpected(Location at) {
    const Character c = decode(text_.substr(at_));
    if (c.bytes == 0) {
      fail(at, "this byte is not UTF-8");
    } else if (c.code == '"') {
      fail(at, "texts stand in single quotes: 'text'");
    } else if (c.code < 0x20 || c.code == 0x7F) {
      fail(at, fmt::format("unexpected control character U+{:04X}", c.code));
    } else if (c.code < 0x80) {
      fail(at, fmt::format("unexpected character '{}'{}", peek(), foreign_sign(peek())));
    } else {
      fail(at, fmt::format("unexpected character '{}' (U+{:04X})", text_.substr(at_, c.bytes), c.code));
    }
    at_ += c.bytes > 0 ? c.bytes : 1;
    ++column_;
  }

  std::string_view text_;
  std::uint32_t file_;
  Diagnostics& diagnostics_;
  std::size_t at_ = 0;
  std::uint32_t line_ = 1, column_ = 1;
  Tokens tokens_;
  std::vector<Line> lines_;
  bool bad_ = false;  // the line so far has an error
};

}  // namespace

std::string spell(const Token& token) {
  switch (token.kind) {
    case TokenKind::kText:
      return fmt::format("'{}'", token.text);
    case TokenKind::kParameter:
      return fmt::format("${}", token.text);
    case TokenKind::kLocal:
      return fmt::format(":{}", token.text);
    case TokenKind::kLabel:
      return fmt::format("#{}", token.text);
    case TokenKind::kLocalLabel:
      return fmt::format(":#{}", token.text);
    case TokenKind::kDirective:
      return fmt::format("!{}", token.text);
    case TokenKind::kName:
      return written(token.text);
    default:
      return token.text;
  }
}

std::string written(const std::string& name) {
  const std::size_t colon = name.find(':');
  if (colon == std::string::npos) return name;
  const std::string plain = name.substr(0, colon);
  return plain.front() == '$' ? plain : fmt::format(":{}", plain);
}

std::vector<Line> lex(const Sources& sources, std::uint32_t file, Diagnostics& diagnostics) {
  if (sources.file(file).text.size() > kMaxFileBytes) {
    diagnostics.error({file, 0, 0, 0}, fmt::format("the file is larger than {} bytes", kMaxFileBytes));
    return {};
  }
  return Lexer(sources, file, diagnostics).run();
}

}  // namespace apron::syntax

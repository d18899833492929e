#include "apron/run/import/KernelTokens.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cstdlib>
#include <optional>
#include <set>
#include <system_error>
#include <utility>

namespace apron::run {
namespace {

bool is_word(char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_'; }
bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r'; }

std::string trim(std::string_view text) {
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return std::string(text);
}

bool is_hexadecimal(std::string_view text) { return text.starts_with("0x") || text.starts_with("0X"); }

bool is_integer_suffix(std::string_view text) {
  std::string suffix;
  for (const char c : text) suffix += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  if (suffix.starts_with('u'))
    suffix.erase(0, 1);
  else if (suffix.ends_with('u'))
    suffix.pop_back();
  return suffix.empty() || suffix == "l" || suffix == "ll" || suffix == "z";
}

// The end of the number of C++ that begins the text: a sign belongs to it behind the letter of an exponent.
std::size_t number_end(std::string_view text) {
  const std::string_view exponents = is_hexadecimal(text) ? "pP" : "eE";
  std::size_t end = 1;
  for (; end < text.size(); ++end) {
    const char c = text[end];
    const bool is_sign = (c == '+' || c == '-') && exponents.find(text[end - 1]) != std::string_view::npos;
    const bool is_separator = c == '\'' && end + 1 < text.size() && is_word(text[end + 1]);
    if (!is_word(c) && c != '.' && !is_separator && !is_sign) break;
  }
  return end;
}

std::optional<KernelToken> read_integer(const std::string& digits) {
  const bool is_hex = is_hexadecimal(digits);
  const bool is_binary = digits.starts_with("0b") || digits.starts_with("0B");
  const bool is_octal = !is_hex && !is_binary && digits.size() > 1 && digits[0] == '0';
  const int base = is_hex ? 16 : is_binary ? 2 : is_octal ? 8 : 10;
  const char* const first = digits.data() + (is_hex || is_binary ? 2 : 0);
  const char* const last = digits.data() + digits.size();
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(first, last, value, base);
  const std::string_view suffix(end, last - end);
  if (error != std::errc{} || !is_integer_suffix(suffix)) return std::nullopt;
  KernelToken token{KernelTokenKind::kNumber,
                    is_hex ? digits.substr(0, end - digits.data()) : std::to_string(value)};
  constexpr std::uint64_t kMaxInt = 0x7fffffff;
  if (suffix.find_first_of("uU") != std::string_view::npos || (base != 10 && value > kMaxInt))
    token.number = KernelNumber::kUnsigned;
  return token;
}

std::optional<KernelToken> read_fraction(const std::string& digits) {
  const bool is_hex = is_hexadecimal(digits);
  if (digits.find_first_of(is_hex ? "pP" : ".eE") == std::string::npos) return std::nullopt;
  char* end = nullptr;
  const double value = std::strtod(digits.c_str(), &end);
  const std::string_view suffix(end);
  if (!suffix.empty() && suffix != "f" && suffix != "F" && suffix != "l" && suffix != "L")
    return std::nullopt;
  KernelToken token{KernelTokenKind::kNumber,
                    is_hex ? fmt::format("{}", value) : digits.substr(0, end - digits.c_str())};
  token.number = KernelNumber::kFloat;
  return token;
}

// A C++ literal as APRON writes it.
KernelToken read_number(std::string_view literal) {
  std::string digits(literal);
  std::erase(digits, '\'');
  std::optional<KernelToken> token = read_integer(digits);
  if (!token) token = read_fraction(digits);
  if (!token) token = KernelToken{KernelTokenKind::kString, std::string(literal)};
  token->spelling = literal;
  return *token;
}

// The value of what stands between the quotes of a character; nothing if it is not one of ASCII.
std::optional<int> character_value(std::string_view text) {
  if (text.size() == 1 && text[0] > 0 && text[0] != '\\') return text[0];
  if (text.size() != 2 || text[0] != '\\') return std::nullopt;
  static constexpr std::string_view kNames = "abtnvfr0\\'\"?", kValues{"\a\b\t\n\v\f\r\0\\'\"?", 12};
  const std::size_t index = kNames.find(text[1]);
  if (index == std::string_view::npos) return std::nullopt;
  return kValues[index];
}

// True if a comment that a slash and an asterisk begin goes on behind the text.
bool ends_in_comment(std::string_view text) {
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text.substr(i).starts_with("//")) return false;
    if (text[i] == '"' || text[i] == '\'') {
      const std::size_t end = text.find(text[i], i + 1);
      if (end != std::string_view::npos) i = end;
    } else if (text.substr(i).starts_with("/*")) {
      const std::size_t end = text.find("*/", i + 2);
      if (end == std::string_view::npos) return true;
      i = end + 1;
    }
  }
  return false;
}

class Scanner {
 public:
  Scanner(std::string_view text, std::size_t line, std::size_t file)
      : text_(text), line_(line), file_(file) {}

  std::vector<KernelToken> scan() {
    while (!text_.empty()) scan_one();
    add(KernelTokenKind::kEnd, "");
    return std::move(tokens_);
  }

 private:
  void add(KernelTokenKind kind, std::string text) {
    tokens_.push_back({kind, std::move(text), line_, file_});
  }

  void add(KernelToken token) {
    token.line = line_;
    token.file = file_;
    tokens_.push_back(std::move(token));
  }

  void skip(std::size_t count) {
    count = std::min(count, text_.size());
    line_ += std::count(text_.begin(), text_.begin() + count, '\n');
    at_line_start_ = count > 0 && text_[count - 1] == '\n';
    text_.remove_prefix(count);
  }

  void scan_one() {
    const char c = text_.front();
    if (c == '\n' || is_blank(c)) {
      const bool kept = at_line_start_ && c != '\n';
      skip(1);
      at_line_start_ = at_line_start_ || kept;
    } else if (text_.starts_with("\\\n")) {
      skip(2);
      at_line_start_ = false;
    } else if (text_.starts_with("//")) {
      std::size_t end = std::min(text_.find('\n'), text_.size());
      while (end < text_.size() && trim(text_.substr(0, end)).ends_with('\\'))
        end = std::min(text_.find('\n', end + 1), text_.size());
      std::string comment = trim(text_.substr(2, end - 2));
      std::ranges::replace(comment, '\n', ' ');
      add(KernelTokenKind::kComment, std::move(comment));
      skip(end);
    } else if (text_.starts_with("/*")) {
      const std::size_t end = std::min(text_.find("*/", 2), text_.size());
      add(KernelTokenKind::kComment, "");
      skip(end + 2);
    } else if (c == '#' && at_line_start_) {
      scan_directive();
    } else if (c == '"' || c == '\'') {
      scan_quoted(c);
    } else if (std::isdigit(static_cast<unsigned char>(c)) != 0 ||
               (c == '.' && text_.size() > 1 && std::isdigit(static_cast<unsigned char>(text_[1])) != 0)) {
      const std::size_t end = number_end(text_);
      add(read_number(text_.substr(0, end)));
      skip(end);
    } else if (is_word(c)) {
      std::size_t end = 1;
      while (end < text_.size() && is_word(text_[end])) ++end;
      add(KernelTokenKind::kName, std::string(text_.substr(0, end)));
      skip(end);
    } else {
      std::size_t size = 1;
      for (const std::string_view symbol :
           {"<=", ">=", "==", "!=", "&&", "||", "++", "--", "+=", "-=",  "*=", "/=",
            "%=", "&=", "|=", "^=", "<<", ">>", "->", "::", "##", "<<=", ">>="})
        if (text_.starts_with(symbol)) size = symbol.size();
      add(KernelTokenKind::kPunctuator, std::string(text_.substr(0, size)));
      skip(size);
    }
  }

  // A logical line, with continuations joined.
  void scan_directive() {
    const std::size_t line = line_;
    std::string logical;
    skip(1);
    while (!text_.empty()) {
      const std::size_t end = std::min(text_.find('\n'), text_.size());
      std::string part = trim(text_.substr(0, end));
      const bool continued = !part.empty() && part.back() == '\\';
      if (continued) part.pop_back();
      // A comment goes on in the next line.
      logical += (logical.empty() ? "" : logical.find("//") != std::string::npos ? " " : "\n") + part;
      skip(end);
      if ((!continued && !ends_in_comment(logical)) || text_.empty()) break;
      skip(1);
    }
    tokens_.push_back({KernelTokenKind::kDirective, logical, line, file_});
  }

  void scan_quoted(char quote) {
    std::size_t end = 1;
    while (end < text_.size() && text_[end] != quote && text_[end] != '\n')
      end += text_[end] == '\\' ? 2U : 1U;
    end = std::min(end, text_.size());
    const std::string_view text = text_.substr(1, end - 1);
    const std::optional<int> character = quote == '\'' ? character_value(text) : std::nullopt;
    if (character) {
      KernelToken token{KernelTokenKind::kNumber, std::to_string(*character)};
      token.number = KernelNumber::kCharacter;
      add(std::move(token));
    } else {
      add(KernelTokenKind::kString, std::string(text));
    }
    skip(end + 1);
  }

  std::string_view text_;
  std::size_t line_, file_;
  bool at_line_start_ = true;
  std::vector<KernelToken> tokens_;
};

}  // namespace

std::vector<KernelToken> scan_kernel_source(std::string_view text, std::size_t first_line, std::size_t file) {
  return Scanner(text, first_line, file).scan();
}

const KernelToken* find_too_deep(const std::vector<KernelToken>& tokens) {
  std::size_t depth = 0;
  for (const KernelToken& token : tokens) {
    if (token.opens_bracket() && depth++ == kMaxBrackets) return &token;
    if (token.closes_bracket() && depth > 0) --depth;
  }
  return nullptr;
}

BinaryOperator binary_operator(const KernelToken& token) {
  static const std::array<std::set<std::string_view>, 10> kPrecedences = {{{"||"},
                                                                           {"&&"},
                                                                           {"|"},
                                                                           {"^"},
                                                                           {"&"},
                                                                           {"==", "!="},
                                                                           {"<", ">", "<=", ">="},
                                                                           {"<<", ">>"},
                                                                           {"+", "-"},
                                                                           {"*", "/", "%"}}};
  BinaryOperator result{token.is_name("and") ? "&&" : token.is_name("or") ? "||" : token.text};
  if (token.kind != KernelTokenKind::kPunctuator && result.symbol == token.text) return result;
  for (std::size_t level = 0; level < kPrecedences.size(); ++level)
    if (kPrecedences[level].contains(result.symbol)) result.precedence = static_cast<int>(level);
  return result;
}

bool mentions(const std::vector<KernelToken>& tokens, const std::string& name) {
  return std::ranges::any_of(tokens, [&](const KernelToken& token) { return token.is_name(name); });
}

bool is_assignment(const KernelToken& token) {
  return token.kind == KernelTokenKind::kPunctuator && token.text.back() == '=' && !token.is("==") &&
         !token.is("<=") && !token.is(">=") && !token.is("!=");
}

}  // namespace apron::run

#include "apron/run/import/KernelTokens.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdlib>
#include <set>
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

// A C++ literal as APRON writes it.
std::string convert_number(std::string text) {
  std::erase(text, '\'');
  const bool is_binary = text.size() > 2 && text[0] == '0' && (text[1] == 'b' || text[1] == 'B');
  const bool is_hex = text.size() > 2 && text[0] == '0' && (text[1] == 'x' || text[1] == 'X');
  while (!text.empty() && std::string_view("uUlL").find(text.back()) != std::string_view::npos)
    text.pop_back();
  if (!is_hex && !text.empty() && (text.back() == 'f' || text.back() == 'F')) text.pop_back();
  const bool is_octal =
      text.size() > 1 && text[0] == '0' && text.find_first_not_of("01234567") == std::string::npos;
  if (is_octal) return std::to_string(std::strtoull(text.c_str(), nullptr, 8));
  if (!is_binary) return text;
  std::uint64_t value = 0;
  for (std::size_t i = 2; i < text.size(); ++i) value = value * 2 + (text[i] == '1' ? 1U : 0U);
  return std::to_string(value);
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
      std::size_t end = 1;
      while (end < text_.size() && (is_word(text_[end]) || text_[end] == '.' || text_[end] == '\'')) ++end;
      const std::string literal(text_.substr(0, end));
      add(KernelTokenKind::kNumber, convert_number(literal));
      const bool is_hex = literal.starts_with("0x") || literal.starts_with("0X");
      tokens_.back().is_unsigned = literal.find_first_of("uU", is_hex ? 2 : 0) != std::string::npos;
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
      if (!continued || text_.empty()) break;
      skip(1);
    }
    tokens_.push_back({KernelTokenKind::kDirective, logical, line, file_});
  }

  void scan_quoted(char quote) {
    std::size_t end = 1;
    while (end < text_.size() && text_[end] != quote && text_[end] != '\n')
      end += text_[end] == '\\' ? 2U : 1U;
    end = std::min(end, text_.size());
    add(KernelTokenKind::kString, std::string(text_.substr(1, end - 1)));
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

// Tokens of a C++ kernel source: what `apron import` reads of the language.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <string>
#include <string_view>
#include <vector>

namespace apron::run {

enum class KernelTokenKind : std::uint8_t {
  kName,
  kNumber,
  kString,
  kPunctuator,
  kComment,
  kDirective,
  kEnd
};

// What a number's spelling says of its type.
enum class KernelNumber : std::uint8_t {
  kInt,
  kUnsigned,  // with the suffix u, or not decimal and beyond int
  kFloat,
  kCharacter,  // 'a'
};

struct KernelToken {
  KernelTokenKind kind = KernelTokenKind::kEnd;
  std::string text;  // of a comment: its line without the slashes; of a directive: the logical line after '#'
  std::size_t line = 0;
  std::size_t file = 0;  // of the files that the reader has opened: 0 is the kernel's own
  KernelNumber number = KernelNumber::kInt;
  std::string spelling{};  // of a number

  bool is(std::string_view symbol) const { return kind == KernelTokenKind::kPunctuator && text == symbol; }
  bool is_name(std::string_view name) const { return kind == KernelTokenKind::kName && text == name; }
  bool is_name_of(std::initializer_list<std::string_view> names) const {
    return kind == KernelTokenKind::kName && std::ranges::find(names, text) != names.end();
  }
  bool opens_bracket() const { return is("(") || is("[") || is("{"); }
  bool closes_bracket() const { return is(")") || is("]") || is("}"); }
};

// Ends with a kEnd token. Unknown characters are punctuators of their own. Numbers are written as APRON
// writes them, without separators of digits and suffixes; what is not a C++ number is a kString.
std::vector<KernelToken> scan_kernel_source(std::string_view text, std::size_t first_line = 1,
                                            std::size_t file = 0);

// The first bracket that stands in more than kMaxBrackets others, or null.
inline constexpr std::size_t kMaxBrackets = 200;
const KernelToken* find_too_deep(const std::vector<KernelToken>& tokens);

struct BinaryOperator {
  std::string symbol;   // of `and` and `or`: && and ||
  int precedence = -1;  // 0 (||) to 9 (* / %); −1: not a binary operator
};
BinaryOperator binary_operator(const KernelToken&);

// True if the name is among the tokens; if the token is = or += and its kin.
bool mentions(const std::vector<KernelToken>& tokens, const std::string& name);
bool is_assignment(const KernelToken& token);

}  // namespace apron::run

// Numbers in texts of users and files.
#pragma once

#include <charconv>
#include <string>
#include <string_view>

namespace common {

// Returns whether the whole text is a number of that type, without blanks and without a plus sign; if not,
// `value` is unspecified.
template <class Number>
bool parse_number(std::string_view text, Number& value) {
  const char* const end = text.data() + text.size();
  const auto [rest, error] = std::from_chars(text.data(), end, value);
  return error == std::errc{} && rest == end;
}

// Appends the shortest text that reads back to the same bits.
template <class Number>
void append_shortest(std::string& text, Number number) {
  char digits[32];
  text.append(digits, std::to_chars(digits, digits + sizeof digits, number).ptr);
}
template <class Number>
std::string shortest(Number number) {
  std::string text;
  append_shortest(text, number);
  return text;
}

}  // namespace common

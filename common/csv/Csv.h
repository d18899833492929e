// Fields and numbers of comma-separated text. Callers interpret the table and word its errors.
#pragma once

#include <charconv>
#include <cstdlib>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

namespace common {

// Removes blanks (space, tab, carriage return) and double quotes at both ends.
std::string_view trim_csv_field(std::string_view text);

// The trimmed fields of one line; a line without a comma has one field. Views into `line`.
std::vector<std::string_view> split_csv_line(std::string_view line);

// Appends a field as RFC 4180 has it: quoted where it holds a comma, a quote or a line break.
void append_csv_field(std::string& text, std::string_view field);

// Parses the whole text as a number; a plus sign may precede it. A floating-point number out of range becomes
// infinite or 0.
template <class Number>
std::optional<Number> parse_csv_number(std::string_view text) {
  if (!text.empty() && text.front() == '+') text.remove_prefix(1);
  Number value{};
  const char* const end = text.data() + text.size();
  const auto [rest, error] = std::from_chars(text.data(), end, value);
  if constexpr (std::is_floating_point_v<Number>)
    if (error == std::errc::result_out_of_range && rest == end)
      return static_cast<Number>(std::is_same_v<Number, float>
                                     ? std::strtof(std::string(text).c_str(), nullptr)
                                     : std::strtod(std::string(text).c_str(), nullptr));
  if (error != std::errc{} || rest != end) return std::nullopt;
  return value;
}

}  // namespace common

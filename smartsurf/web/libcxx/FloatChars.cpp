// First, because it includes the header below.
#include <charconv>

#include "smartsurf/web/libcxx/FloatChars.h"

#include <fast_float/fast_float.h>
#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <cstring>
#include <string>
#include <string_view>

namespace smartsurf::web::libcxx {
namespace {

enum class Style { kShorter, kGeneral, kScientific, kFixed };

// A finite number other than 0: digits × 10^exponent.
struct Decimal {
  std::string digits;
  int exponent;
  int count() const { return static_cast<int>(digits.size()); }
  int scientific() const { return exponent + count() - 1; }
};

template <class Number>
Decimal shortest(Number value) {
  const auto decimal = fmt::detail::dragonbox::to_decimal(value);
  return {std::to_string(decimal.significand), decimal.exponent};
}

// Where the digits end before the point, the number has more of them than the shortest ones.
template <class Number>
std::string fixed(const Decimal& d, Number value) {
  if (d.exponent >= 0) {
    char text[512];
    return {text, static_cast<std::size_t>(std::snprintf(text, sizeof text, "%.0f", double{value}))};
  }
  const int whole = d.count() + d.exponent;
  if (whole > 0) return d.digits.substr(0, whole) + "." + d.digits.substr(whole);
  return "0." + std::string(-whole, '0') + d.digits;
}

std::string scientific(const Decimal& d) {
  const int exponent = d.scientific(), size = std::abs(exponent);
  return d.digits.substr(0, 1) + (d.count() > 1 ? "." + d.digits.substr(1) : "") +
         (exponent < 0 ? "e-" : "e+") + (size < 10 ? "0" : "") + std::to_string(size);
}

int fixed_length(const Decimal& d) {
  if (d.exponent >= 0) return d.count() + d.exponent;
  return d.count() + d.exponent > 0 ? d.count() + 1 : 2 - d.exponent;
}

template <class Number>
std::string format(Number value, Style style) {
  if (value == 0) return style == Style::kScientific ? "0e+00" : "0";
  const Decimal d = shortest(value);
  if (style == Style::kShorter)
    style = fixed_length(d) <= static_cast<int>(scientific(d).size()) ? Style::kFixed : Style::kScientific;
  if (style == Style::kGeneral)
    style = -4 <= d.scientific() && d.scientific() < 6 ? Style::kFixed : Style::kScientific;
  return style == Style::kFixed ? fixed(d, value) : scientific(d);
}

template <class Number>
std::to_chars_result write(char* first, char* last, Number value, Style style) {
  std::string text = std::signbit(value) ? "-" : "";
  if (std::isnan(value))
    text += "nan";
  else if (std::isinf(value))
    text += "inf";
  else
    text += format(std::abs(value), style);
  if (std::ssize(text) > last - first) return {last, std::errc::value_too_large};
  std::memcpy(first, text.data(), text.size());
  return {first + text.size(), std::errc()};
}

template <class Number>
std::to_chars_result write(char* first, char* last, Number value, std::chars_format format) {
  switch (format) {
    case std::chars_format::general:
      return write(first, last, value, Style::kGeneral);
    case std::chars_format::scientific:
      return write(first, last, value, Style::kScientific);
    case std::chars_format::fixed:
      return write(first, last, value, Style::kFixed);
    default:
      return {last, std::errc::invalid_argument};
  }
}

// fast_float returns infinity and 0 for what is out of range.
bool is_out_of_range(std::string_view text, double value) {
  if (text.starts_with('-')) text.remove_prefix(1);
  const bool is_number = text.front() == '.' || (text.front() >= '0' && text.front() <= '9');
  if (std::isinf(value)) return is_number;
  return value == 0 && text.substr(0, text.find_first_of("eE")).find_first_of("123456789") != text.npos;
}

template <class Number>
std::from_chars_result read(const char* first, const char* last, Number& value, std::chars_format format) {
  if (format == std::chars_format::hex) return {first, std::errc::invalid_argument};
  Number parsed{};
  const auto [end, error] = fast_float::from_chars(
      first, last, parsed,
      static_cast<fast_float::chars_format>((format == std::chars_format::general ? fast_float::general
                                             : format == std::chars_format::fixed ? fast_float::fixed
                                                                                  : fast_float::scientific)));
  if (error != std::errc()) return {end, error};
  if (is_out_of_range({first, static_cast<std::size_t>(end - first)}, parsed))
    return {end, std::errc::result_out_of_range};
  value = parsed;
  return {end, std::errc()};
}

}  // namespace

std::to_chars_result to_chars(char* first, char* last, float value) {
  return write(first, last, value, Style::kShorter);
}
std::to_chars_result to_chars(char* first, char* last, double value) {
  return write(first, last, value, Style::kShorter);
}
std::to_chars_result to_chars(char* first, char* last, float value, std::chars_format format) {
  return write(first, last, value, format);
}
std::to_chars_result to_chars(char* first, char* last, double value, std::chars_format format) {
  return write(first, last, value, format);
}
std::from_chars_result from_chars(const char* first, const char* last, float& value,
                                  std::chars_format format) {
  return read(first, last, value, format);
}
std::from_chars_result from_chars(const char* first, const char* last, double& value,
                                  std::chars_format format) {
  return read(first, last, value, format);
}

}  // namespace smartsurf::web::libcxx

// Numbers as the console prints them: the shortest text that reads back as the same float.
#pragma once

#include <array>
#include <string>
#include <string_view>

namespace apron::vm {

using NumberBuffer = std::array<char, 64>;

// Examples: "3", "0.1", "-1e+20", "nan", "inf". The text lives in `buffer`; does not allocate.
std::string_view format_number(float value, NumberBuffer& buffer) noexcept;
std::string format_number(float value);
// The number of a scalar, with all digits of a whole number that is not a 32-bit float.
std::string_view format_number(double value, NumberBuffer& buffer) noexcept;
std::string format_number(double value);

}  // namespace apron::vm

// Numbers as the console prints them: the shortest text that reads back as the same float.
#pragma once

#include <array>
#include <string>
#include <string_view>

namespace apron::vm {

using NumberBuffer = std::array<char, 64>;

// "3", "0.1", "-1e+20", "nan", "inf". The text lies in `buffer`; nothing is allocated.
std::string_view format_number(float value, NumberBuffer& buffer) noexcept;
std::string format_number(float value);

}  // namespace apron::vm

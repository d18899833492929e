// Text from files and other programs, made safe to show on a terminal.
#pragma once

#include <string>
#include <string_view>

namespace common {

// `text` with every control character, line breaks and the C1 codes of UTF-8 included, replaced by '?'. An
// escape sequence in a file's attribute must not reach the terminal.
std::string printable(std::string_view text);

// Prints "PROGRAM: TEXT" to standard error as one line, made printable. Allocates nothing and is
// async-signal-safe, so that it can also report that there is no memory.
void print_error_line(const char* program, std::string_view text) noexcept;

}  // namespace common

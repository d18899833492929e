// All that the programs print. Control characters of files, scripts and other programs never reach a
// terminal.
#pragma once

#include <string>
#include <string_view>

namespace common {

// `text` with every control character, line breaks, the C1 codes of UTF-8 and Unicode's line separators and
// bidirectional controls included, and every byte that is not UTF-8 replaced by '?'. An escape sequence in a
// file's attribute must not reach the terminal.
std::string printable(std::string_view text);
// Likewise, with line breaks and tabs.
std::string printable_lines(std::string_view text);

// Prints to standard output; to a terminal as by printable(), but with line breaks and tabs. A failure is
// seen in ferror(stdout) at the end of the program.
void print_output(std::string_view text);

// Prints to standard error as print_output() does to a terminal. A message that cannot be written is lost and
// does not end the work that it is about.
void print_message(std::string_view text) noexcept;

// Prints "PROGRAM: TEXT" to standard error as one line, made printable. Allocates nothing and is
// async-signal-safe, so that it can also report that there is no memory.
void print_error_line(const char* program, std::string_view text) noexcept;

}  // namespace common

#include "common/text/Printable.h"

#include <unistd.h>

#include <array>
#include <cstddef>
#include <cstdio>

namespace common {
namespace {

enum class LineBreaks { kKept, kReplaced };  // and tabs

// Bytes of the character that `text` begins with; 0 if it is not UTF-8 (Unicode, table 3-7).
std::size_t length_of_character(std::string_view text) {
  const auto byte = [&](std::size_t i) {
    return static_cast<unsigned char>(i < text.size() ? text[i] : '\0');
  };
  const auto continues = [&](std::size_t from, std::size_t to) {
    while (from < to && (byte(from) & 0xC0U) == 0x80) ++from;
    return from == to;
  };
  const unsigned first = byte(0), second = byte(1);
  if (first < 0x80) return 1;
  if (first >= 0xC2 && first < 0xE0) return continues(1, 2) ? 2 : 0;
  if (first >= 0xE0 && first < 0xF0)
    return continues(1, 3) && (first != 0xE0 || second >= 0xA0) && (first != 0xED || second < 0xA0) ? 3 : 0;
  if (first >= 0xF0 && first < 0xF5)
    return continues(1, 4) && (first != 0xF0 || second >= 0x90) && (first != 0xF4 || second < 0x90) ? 4 : 0;
  return 0;
}

template <class Put>
void for_each_printable(std::string_view text, LineBreaks line_breaks, Put put) {
  while (!text.empty()) {
    const std::size_t length = length_of_character(text);
    const char c = text[0];
    const bool is_c1 = length == 2 && c == '\xC2' && static_cast<unsigned char>(text[1]) < 0xA0;
    const bool is_control = length == 1 && (static_cast<unsigned char>(c) < 0x20 || c == 0x7F);
    const bool is_kept_break = line_breaks == LineBreaks::kKept && (c == '\n' || c == '\t');
    if (length == 0 || is_c1 || (is_control && !is_kept_break))
      put('?');
    else
      for (std::size_t i = 0; i < length; ++i) put(text[i]);
    text.remove_prefix(length == 0 ? 1 : length);
  }
}

void write_to_standard_error(const char* text, std::size_t bytes) noexcept {
  while (bytes != 0) {
    const ssize_t written = ::write(STDERR_FILENO, text, bytes);
    if (written <= 0) return;
    text += written;
    bytes -= written;
  }
}

// Collects characters, so that a line is written as a whole where it fits.
class StandardError {
 public:
  ~StandardError() { write_to_standard_error(block_.data(), used_); }
  void put(char c) {
    block_[used_++] = c;
    if (used_ < block_.size()) return;
    write_to_standard_error(block_.data(), used_);
    used_ = 0;
  }

 private:
  std::array<char, 2048> block_;
  std::size_t used_ = 0;
};

}  // namespace

std::string printable(std::string_view text) {
  std::string result;
  result.reserve(text.size());
  for_each_printable(text, LineBreaks::kReplaced, [&](char c) { result += c; });
  return result;
}

void print_output(std::string_view text) {
  static const bool is_terminal = ::isatty(STDOUT_FILENO) != 0;
  if (is_terminal)
    for_each_printable(text, LineBreaks::kKept, [](char c) { std::putchar(c); });
  else
    std::fwrite(text.data(), 1, text.size(), stdout);
}

void print_message(std::string_view text) noexcept {
  StandardError out;
  for_each_printable(text, LineBreaks::kKept, [&](char c) { out.put(c); });
}

void print_error_line(const char* program, std::string_view text) noexcept {
  StandardError out;
  for (const char* c = program; *c != '\0'; ++c) out.put(*c);
  out.put(':');
  out.put(' ');
  for_each_printable(text, LineBreaks::kReplaced, [&](char c) { out.put(c); });
  out.put('\n');
}

}  // namespace common

#include "common/text/Printable.h"

#include <unistd.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdio>

#include "common/text/Utf8.h"

namespace common {
namespace {

enum class LineBreaks { kKept, kReplaced };  // and tabs

// Also Unicode's: separators of lines and paragraphs, and bidirectional marks, embeddings, overrides and
// isolates, by which a text shows as another one.
bool is_control(std::uint32_t code) {
  return code < 0x20 || (code >= 0x7F && code < 0xA0) || code == 0x061C || code == 0x200E || code == 0x200F ||
         (code >= 0x2028 && code <= 0x202E) || (code >= 0x2066 && code <= 0x2069);
}

template <class Put>
void for_each_printable(std::string_view text, LineBreaks line_breaks, Put put) {
  while (!text.empty()) {
    const CodePoint c = decode_utf8(text);
    const std::size_t bytes = c.bytes == 0 ? 1 : c.bytes;
    const bool is_kept_break = line_breaks == LineBreaks::kKept && (c.code == '\n' || c.code == '\t');
    if (c.bytes == 0 || (is_control(c.code) && !is_kept_break))
      put('?');
    else
      for (const char byte : text.substr(0, bytes)) put(byte);
    text.remove_prefix(bytes);
  }
}

std::string printable(std::string_view text, LineBreaks line_breaks) {
  std::string result;
  result.reserve(text.size());
  for_each_printable(text, line_breaks, [&](char c) { result += c; });
  return result;
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

std::string printable(std::string_view text) { return printable(text, LineBreaks::kReplaced); }

std::string printable_lines(std::string_view text) { return printable(text, LineBreaks::kKept); }

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

#include "common/text/Printable.h"

#include <unistd.h>

#include <array>
#include <cstddef>

namespace common {
namespace {

template <class Put>
void for_each_printable(std::string_view text, Put put) {
  for (std::size_t i = 0; i < text.size(); ++i) {
    const auto c = static_cast<unsigned char>(text[i]);
    const auto next = static_cast<unsigned char>(i + 1 < text.size() ? text[i + 1] : 0);
    if (c == 0xC2 && next >= 0x80 && next < 0xA0) {  // U+0080 to U+009F
      put('?');
      ++i;
    } else {
      put(c < 0x20 || c == 0x7F ? '?' : static_cast<char>(c));
    }
  }
}

void write_to_standard_error(const char* text, std::size_t bytes) noexcept {
  while (bytes != 0) {
    const ssize_t written = ::write(STDERR_FILENO, text, bytes);
    if (written <= 0) return;
    text += written;
    bytes -= static_cast<std::size_t>(written);
  }
}

}  // namespace

std::string printable(std::string_view text) {
  std::string result;
  result.reserve(text.size());
  for_each_printable(text, [&](char c) { result += c; });
  return result;
}

void print_error_line(const char* program, std::string_view text) noexcept {
  std::array<char, 512> block;
  std::size_t used = 0;
  const auto put = [&](char c) {
    block[used++] = c;
    if (used < block.size()) return;
    write_to_standard_error(block.data(), used);
    used = 0;
  };
  for (const char* c = program; *c != '\0'; ++c) put(*c);
  put(':');
  put(' ');
  for_each_printable(text, put);
  put('\n');
  write_to_standard_error(block.data(), used);
}

}  // namespace common

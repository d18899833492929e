#include "apron/language_server/MessageStream.h"

#include <algorithm>
#include <istream>
#include <ostream>

#include "common/error/UserError.h"
#include "common/text/Number.h"
#include "common/text/Words.h"

namespace apron::language_server {
namespace {

constexpr std::size_t kMaxHeaderBytes = 4096;

// Reads a line without its end; false at the end of the input.
bool read_line(std::istream& in, std::string& line) {
  line.clear();
  for (int c = in.get(); c != std::istream::traits_type::eof(); c = in.get()) {
    if (c == '\n') {
      if (!line.empty() && line.back() == '\r') line.pop_back();
      return true;
    }
    if (line.size() == kMaxHeaderBytes)
      throw common::UserError("apron lsp: a header line has more than " + std::to_string(kMaxHeaderBytes) +
                              " bytes");
    line += static_cast<char>(c);
  }
  return false;
}

}  // namespace

std::optional<std::string> MessageStream::read() {
  constexpr std::string_view kLength = "content-length:";
  std::optional<std::size_t> length;
  std::string line;
  while (true) {
    if (!read_line(in_, line)) return std::nullopt;
    if (line.empty()) {
      if (length) break;
      continue;  // an empty line between messages
    }
    if (common::lower_case(line.substr(0, kLength.size())) != kLength) continue;
    std::string_view digits = std::string_view(line).substr(kLength.size());
    digits.remove_prefix(std::min(digits.find_first_not_of(' '), digits.size()));
    std::size_t value = 0;
    if (!common::parse_number(digits, value) || value > kMaxMessageBytes)
      throw common::UserError("apron lsp: '" + line + "': must be a number of at most " +
                              std::to_string(kMaxMessageBytes) + " bytes");
    length = value;
  }
  std::string text(*length, '\0');
  in_.read(text.data(), static_cast<std::streamsize>(text.size()));
  if (in_.gcount() != std::ssize(text)) return std::nullopt;
  return text;
}

void MessageStream::write(const std::string& message) {
  out_ << "Content-Length: " << message.size() << "\r\n\r\n" << message << std::flush;
}

}  // namespace apron::language_server

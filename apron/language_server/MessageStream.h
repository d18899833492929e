// JSON-RPC messages with the header of the Language Server Protocol, on standard input and output.
#pragma once

#include <iosfwd>
#include <optional>
#include <string>

namespace apron::language_server {

class MessageStream {
 public:
  static constexpr std::size_t kMaxMessageBytes = std::size_t{64} << 20;

  MessageStream(std::istream& in, std::ostream& out) : in_(in), out_(out) {}

  // The next message's text; nullopt at the end of the input. Throws common::UserError for a header from
  // which the stream cannot go on.
  std::optional<std::string> read();
  void write(const std::string& message);

 private:
  std::istream& in_;
  std::ostream& out_;
};

}  // namespace apron::language_server

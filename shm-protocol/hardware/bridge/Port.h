// The connection to the device: a serial terminal in raw mode, or TCP. Reads and writes do not block.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

namespace hardware {

// What the user named: "tcp:HOST:PORT", or the path of a terminal.
struct PortAddress {
  std::string text;
  std::string host, service;  // tcp; empty for a terminal
  unsigned baud = 115200;

  bool tcp() const { return !service.empty(); }
  // Throws std::invalid_argument, with one line, for what cannot be one.
  static PortAddress parse(const std::string& text, unsigned baud);
};

class Port {
 public:
  // Nothing when the device is not there; `why` then says so. Waits for a TCP connection for at most a
  // second.
  static std::optional<Port> open(const PortAddress&, std::string& why);
  ~Port();
  Port(Port&&) noexcept;
  Port& operator=(Port&&) noexcept;

  int descriptor() const { return descriptor_; }
  // How many bytes were read or written, 0 when none can be now, and nothing when the device is gone.
  std::optional<std::size_t> read(std::span<std::uint8_t>);
  std::optional<std::size_t> write(std::span<const std::uint8_t>);

 private:
  Port(int descriptor, bool tcp) : descriptor_(descriptor), tcp_(tcp) {}

  int descriptor_;
  bool tcp_;
};

}  // namespace hardware

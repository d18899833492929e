// The connection to the device: a serial terminal in raw mode, or TCP. Reads and writes do not block.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace hardware {

// A device address: "tcp:HOST:PORT" or the path of a terminal.
struct PortAddress {
  std::string text;
  std::string host, service;  // tcp; empty for a terminal
  // The local port for tcp; 0: any. A device that still holds a connection, which its network has cut, gives
  // it up when the next one comes from the same port.
  std::uint16_t local_port = 0;
  unsigned baud = 115200;

  bool tcp() const { return !service.empty(); }
  static constexpr const char* kUsualSpeeds = "9600, 115200, 921600 and 4000000 are some";
  static bool is_usual_speed(std::int64_t baud);
  // Throws std::invalid_argument with a one-line message if `text` is not a valid address.
  static PortAddress parse(const std::string& text, unsigned baud);
};

class Port {
 public:
  // Returns nothing, and the reason in `why`, if the device is unavailable. Waits at most one second for a
  // TCP connection.
  static std::optional<Port> open(const PortAddress&, std::string& why);
  ~Port();
  Port(Port&&) noexcept;
  Port& operator=(Port&&) noexcept;

  int descriptor() const { return descriptor_; }
  std::uint16_t local_port() const;  // 0: a terminal
  // Returns the number of bytes transferred, 0 if the call would block, nothing if the device is gone: also
  // if the network has acknowledged nothing for two seconds.
  std::optional<std::size_t> read(std::span<std::uint8_t>);
  std::optional<std::size_t> write(std::span<const std::uint8_t>);
  // Writes and removes as many of the pending bytes as it can without blocking; false if the device is gone.
  bool flush(std::vector<std::uint8_t>& pending);

 private:
  Port(int descriptor, bool tcp) : descriptor_(descriptor), tcp_(tcp) {}

  int descriptor_;
  bool tcp_;
};

}  // namespace hardware

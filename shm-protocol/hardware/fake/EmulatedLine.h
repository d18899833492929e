// The device's end of a line that can be unplugged: a pseudo-terminal under a stable path, or a TCP server.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace hardware {

class EmulatedLine {
 public:
  // `link`: the symbolic link to create for the terminal, in place of one that is stale. Throws
  // std::invalid_argument if anything else has that path, or std::runtime_error.
  static EmulatedLine terminal(const std::string& link) { return EmulatedLine(link, 0, false); }
  // Listens on 127.0.0.1; port 0: any free port.
  static EmulatedLine tcp(std::uint16_t port) { return EmulatedLine({}, port, true); }
  ~EmulatedLine() { unplug(); }
  EmulatedLine(const EmulatedLine&) = delete;
  EmulatedLine& operator=(const EmulatedLine&) = delete;

  void plug();
  void unplug();
  bool plugged() const { return line_ >= 0 || listener_ >= 0; }
  // Returns whether a host had the line open at the last read().
  bool has_host() const { return has_host_; }

  // The DEVICE argument for surface_bridge.
  std::string name() const;
  int descriptor() const { return line_ >= 0 ? line_ : listener_; }

  // Appends received bytes; accepts the host when it connects.
  void read(std::vector<std::uint8_t>& to);
  // Sends what the line accepts without blocking and queues the rest.
  void write(const std::vector<std::uint8_t>& bytes);
  std::size_t pending_bytes() const { return pending_.size(); }

 private:
  EmulatedLine(std::string link, std::uint16_t port, bool tcp);
  void open_terminal();
  void open_listener();

  std::string link_, terminal_;  // terminal_: where the link leads
  std::uint16_t port_;
  bool tcp_;
  int line_ = -1, listener_ = -1;
  bool has_host_ = false;
  std::vector<std::uint8_t> pending_;
};

}  // namespace hardware

#include "shm-protocol/hardware/fake/EmulatedLine.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <utility>

namespace hardware {
namespace {

constexpr std::size_t kMaxPendingBytes = std::size_t{1} << 20;  // excess bytes are lost, as in a device

[[noreturn]] void fail(const std::string& what) {
  throw std::runtime_error(what + ": " + std::strerror(errno));
}

// Throws if this path leads to anything but a pseudo-terminal, or nowhere: that is not ours to replace.
void require_own(const std::string& link) {
  namespace fs = std::filesystem;
  std::error_code none;
  const fs::file_status found = fs::symlink_status(link, none);
  if (!fs::exists(found)) return;
  const bool is_link = found.type() == fs::file_type::symlink;
  if (is_link && (!fs::exists(link, none) || fs::read_symlink(link, none).string().starts_with("/dev/pts/")))
    return;
  throw std::invalid_argument(link + " exists and is no link to a pseudo-terminal; it is not replaced");
}

void close_descriptor(int& descriptor) {
  if (descriptor >= 0) ::close(descriptor);
  descriptor = -1;
}

}  // namespace

EmulatedLine::EmulatedLine(std::string link, std::uint16_t port, bool tcp)
    : link_(std::move(link)), port_(port), tcp_(tcp) {
  plug();
}

void EmulatedLine::plug() {
  if (plugged()) return;
  if (tcp_)
    open_listener();
  else
    open_terminal();
}

void EmulatedLine::open_terminal() {
  require_own(link_);
  line_ = ::posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  std::array<char, 128> path{};
  if (line_ < 0 || ::grantpt(line_) != 0 || ::unlockpt(line_) != 0 ||
      ::ptsname_r(line_, path.data(), path.size()) != 0)
    fail("cannot open a pseudo-terminal");
  termios settings{};
  ::tcgetattr(line_, &settings);
  ::cfmakeraw(&settings);
  ::tcsetattr(line_, TCSANOW, &settings);
  ::unlink(link_.c_str());
  if (::symlink(path.data(), link_.c_str()) != 0) fail("cannot make " + link_);
  terminal_ = path.data();
}

void EmulatedLine::open_listener() {
  listener_ = ::socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  const int yes = 1;
  ::setsockopt(listener_, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  sockaddr_in here{};
  here.sin_family = AF_INET;
  here.sin_port = htons(port_);
  here.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  auto* const address = reinterpret_cast<sockaddr*>(&here);
  socklen_t size = sizeof here;
  if (::bind(listener_, address, size) != 0 || ::listen(listener_, 1) != 0) fail("cannot listen");
  ::getsockname(listener_, address, &size);
  port_ = ntohs(here.sin_port);
}

void EmulatedLine::unplug() {
  std::error_code none;
  if (!tcp_ && line_ >= 0 && std::filesystem::read_symlink(link_, none) == terminal_) ::unlink(link_.c_str());
  close_descriptor(line_);
  close_descriptor(listener_);
  pending_.clear();
  has_host_ = false;
}

std::string EmulatedLine::name() const { return tcp_ ? "tcp:127.0.0.1:" + std::to_string(port_) : link_; }

void EmulatedLine::read(std::vector<std::uint8_t>& to) {
  if (tcp_ && line_ < 0 && listener_ >= 0) {
    line_ = ::accept4(listener_, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
    const int yes = 1;
    if (line_ >= 0) ::setsockopt(line_, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
  }
  if (line_ < 0) return;
  std::array<std::uint8_t, 4096> bytes;
  const ssize_t got = ::read(line_, bytes.data(), bytes.size());
  if (got > 0) to.insert(to.end(), bytes.begin(), bytes.begin() + got);
  has_host_ = got > 0 || (got < 0 && errno == EAGAIN);  // EIO: no process has the pseudo-terminal open
  if (got == 0 && tcp_) {                               // the host disconnected; accept the next one
    close_descriptor(line_);
    pending_.clear();
  }
}

void EmulatedLine::write(const std::vector<std::uint8_t>& bytes) {
  if (line_ < 0 || pending_.size() + bytes.size() > kMaxPendingBytes) return;
  pending_.insert(pending_.end(), bytes.begin(), bytes.end());
  if (pending_.empty()) return;
  const ssize_t put = tcp_ ? ::send(line_, pending_.data(), pending_.size(), MSG_NOSIGNAL)
                           : ::write(line_, pending_.data(), pending_.size());
  if (put > 0) pending_.erase(pending_.begin(), pending_.begin() + put);
}

}  // namespace hardware

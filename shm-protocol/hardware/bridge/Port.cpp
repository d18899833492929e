#include "shm-protocol/hardware/bridge/Port.h"

#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <utility>

#include "common/text/Number.h"

namespace hardware {
namespace {

struct Speed {
  unsigned baud;
  speed_t code;
};
constexpr Speed kSpeeds[] = {{9600, B9600},       {19200, B19200},     {38400, B38400},
                             {57600, B57600},     {115200, B115200},   {230400, B230400},
                             {460800, B460800},   {921600, B921600},   {1000000, B1000000},
                             {2000000, B2000000}, {3000000, B3000000}, {4000000, B4000000}};

std::optional<speed_t> speed_of(unsigned baud) {
  for (const Speed& s : kSpeeds)
    if (s.baud == baud) return s.code;
  return std::nullopt;
}

// Raw mode, 8N1, at the given speed, without flow control; modem control lines are ignored.
bool make_raw(int terminal, speed_t speed) {
  termios settings{};
  if (::tcgetattr(terminal, &settings) != 0) return false;
  ::cfmakeraw(&settings);
  settings.c_cflag |= CLOCAL | CREAD;
  settings.c_iflag &= ~static_cast<tcflag_t>(IXOFF | IXANY);  // cfmakeraw leaves these
  settings.c_cflag &= ~static_cast<tcflag_t>(CSTOPB | CRTSCTS | HUPCL);
  settings.c_cc[VMIN] = 0;
  settings.c_cc[VTIME] = 0;
  if (::cfsetispeed(&settings, speed) != 0 || ::cfsetospeed(&settings, speed) != 0) return false;
  return ::tcsetattr(terminal, TCSANOW, &settings) == 0;
}

int open_terminal(const PortAddress& name, std::string& why) {
  const int terminal = ::open(name.text.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (terminal < 0) {
    why = "cannot open " + name.text + ": " + std::strerror(errno);
    return -1;
  }
  // Two programs on one line would garble each other. The lock also binds root, whom TIOCEXCL lets pass, and
  // TIOCEXCL also those that ask for no lock. A line that knows neither works as well.
  if (::flock(terminal, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) {
    why = "cannot open " + name.text + ": " + std::strerror(EBUSY);
    ::close(terminal);
    return -1;
  }
  if (!make_raw(terminal, *speed_of(name.baud))) {
    why = name.text + (::isatty(terminal) ? ": the line cannot be set up: " : " is no serial line: ") +
          std::strerror(errno);
    ::close(terminal);
    return -1;
  }
  ::ioctl(terminal, TIOCEXCL);
  ::tcflush(terminal, TCIFLUSH);
  return terminal;
}

// A network that acknowledges nothing for so long has cut the line. TCP itself would wait longer and longer
// between two attempts.
constexpr int kUnacknowledged_ms = 2000;

bool connects(int socket, const addrinfo& to) {
  if (::connect(socket, to.ai_addr, to.ai_addrlen) == 0) return true;
  if (errno != EINPROGRESS) return false;
  pollfd ready{socket, POLLOUT, 0};
  if (::poll(&ready, 1, 1000) != 1) {
    errno = ETIMEDOUT;
    return false;
  }
  int failure = 0;
  socklen_t size = sizeof failure;
  ::getsockopt(socket, SOL_SOCKET, SO_ERROR, &failure, &size);
  errno = failure;
  return failure == 0;
}

// Connects from this port if it is free, else from any. Returns the socket, or -1 and errno.
int connect_from(std::uint16_t local_port, const addrinfo& to) {
  const int s = ::socket(to.ai_family, to.ai_socktype | SOCK_NONBLOCK | SOCK_CLOEXEC, to.ai_protocol);
  if (s < 0) return -1;
  const int yes = 1;
  ::setsockopt(s, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
  ::setsockopt(s, IPPROTO_TCP, TCP_USER_TIMEOUT, &kUnacknowledged_ms, sizeof kUnacknowledged_ms);
  if (local_port != 0) {
    sockaddr_in6 from{};  // that of IPv4 begins with the same fields
    from.sin6_family = static_cast<sa_family_t>(to.ai_family);
    from.sin6_port = htons(local_port);
    ::setsockopt(s, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    (void)::bind(s, reinterpret_cast<const sockaddr*>(&from), to.ai_addrlen);
  }
  if (connects(s, to)) return s;
  const int failure = errno;
  ::close(s);
  if (failure == EADDRNOTAVAIL && local_port != 0) return connect_from(0, to);
  errno = failure;
  return -1;
}

int open_tcp(const PortAddress& name, std::string& why) {
  addrinfo hints{}, *found = nullptr;
  hints.ai_socktype = SOCK_STREAM;
  if (const int failure = ::getaddrinfo(name.host.c_str(), name.service.c_str(), &hints, &found);
      failure != 0) {
    why = name.text + ": " + ::gai_strerror(failure);
    return -1;
  }
  int connected = -1;
  for (const addrinfo* to = found; to && connected < 0; to = to->ai_next) {
    connected = connect_from(name.local_port, *to);
    if (connected < 0) why = "cannot connect to " + name.text + ": " + std::strerror(errno);
  }
  ::freeaddrinfo(found);
  return connected;
}

bool is_only_busy(int error) { return error == EAGAIN || error == EWOULDBLOCK || error == EINTR; }

}  // namespace

bool PortAddress::is_usual_speed(std::int64_t baud) {
  return std::ranges::any_of(kSpeeds, [&](const Speed& s) { return s.baud == baud; });
}

PortAddress PortAddress::parse(const std::string& text, unsigned baud) {
  PortAddress name;
  name.text = text;
  name.baud = baud;
  if (!is_usual_speed(baud))
    throw std::invalid_argument("--baud: " + std::to_string(baud) + " is not a usual speed; " + kUsualSpeeds);
  if (text.empty()) throw std::invalid_argument("the device is missing: a serial line or tcp:HOST:PORT");
  if (!text.starts_with("tcp:")) {
    // A missing device may be plugged in later.
    std::error_code none;
    const auto is = std::filesystem::status(text, none).type();
    if (is == std::filesystem::file_type::directory || is == std::filesystem::file_type::regular)
      throw std::invalid_argument(text + " is a " +
                                  (is == std::filesystem::file_type::directory ? "folder" : "file") +
                                  ", not a serial line");
    return name;
  }
  const std::size_t colon = text.rfind(':');
  name.host = colon > 4 ? text.substr(4, colon - 4) : "";
  name.service = text.substr(colon + 1);
  if (name.host.size() > 2 && name.host.front() == '[' && name.host.back() == ']')
    name.host = name.host.substr(1, name.host.size() - 2);
  unsigned port = 0;
  if (name.host.empty() || !common::parse_number(name.service, port) || port < 1 || port > 65535)
    throw std::invalid_argument("'" + text + "' is not tcp:HOST:PORT, such as tcp:127.0.0.1:5000");
  return name;
}

std::optional<Port> Port::open(const PortAddress& name, std::string& why) {
  const int descriptor = name.tcp() ? open_tcp(name, why) : open_terminal(name, why);
  if (descriptor < 0) return std::nullopt;
  return Port(descriptor, name.tcp());
}

Port::~Port() {
  if (descriptor_ >= 0) ::close(descriptor_);
}
Port::Port(Port&& other) noexcept : descriptor_(std::exchange(other.descriptor_, -1)), tcp_(other.tcp_) {}
Port& Port::operator=(Port&& other) noexcept {
  std::swap(descriptor_, other.descriptor_);
  std::swap(tcp_, other.tcp_);
  return *this;
}

std::uint16_t Port::local_port() const {
  sockaddr_in6 here{};
  socklen_t size = sizeof here;
  if (!tcp_ || ::getsockname(descriptor_, reinterpret_cast<sockaddr*>(&here), &size) != 0) return 0;
  return ntohs(here.sin6_port);
}

std::optional<std::size_t> Port::read(std::span<std::uint8_t> to) {
  const ssize_t got = ::read(descriptor_, to.data(), to.size());
  if (got > 0) return got;
  if (got < 0) return is_only_busy(errno) ? std::optional<std::size_t>(0) : std::nullopt;
  if (tcp_) return std::nullopt;  // the other end closed
  // A terminal returns 0 both if there is no input and after a hang-up.
  pollfd line{descriptor_, POLLIN, 0};
  if (::poll(&line, 1, 0) == 1 && (line.revents & (POLLHUP | POLLERR | POLLNVAL))) return std::nullopt;
  return 0;
}

std::optional<std::size_t> Port::write(std::span<const std::uint8_t> from) {
  const ssize_t put = tcp_ ? ::send(descriptor_, from.data(), from.size(), MSG_NOSIGNAL)
                           : ::write(descriptor_, from.data(), from.size());
  if (put >= 0) return put;
  return is_only_busy(errno) ? std::optional<std::size_t>(0) : std::nullopt;
}

bool Port::flush(std::vector<std::uint8_t>& pending) {
  if (pending.empty()) return true;
  const auto written = write(pending);
  if (!written) return false;
  pending.erase(pending.begin(), pending.begin() + *written);
  return true;
}

}  // namespace hardware

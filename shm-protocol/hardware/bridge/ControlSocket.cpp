#include "shm-protocol/hardware/bridge/ControlSocket.h"

#include <poll.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <fstream>
#include <set>
#include <stdexcept>
#include <utility>

namespace hardware {

using namespace std::chrono_literals;

namespace {

constexpr std::size_t kMaxAnswer = std::size_t{1} << 16, kMaxClients = 16;

struct Address {
  sockaddr_un at{};
  socklen_t bytes = 0;
};

std::string name_of(const std::string& surface) {
  return "smartsurf." + std::to_string(::geteuid()) + "." + surface;
}

Address address_of(const std::string& surface) {
  const std::string name = name_of(surface);
  Address a;
  a.at.sun_family = AF_UNIX;
  const std::size_t count = std::min(name.size(), sizeof a.at.sun_path - 1);
  std::memcpy(a.at.sun_path + 1, name.data(), count);  // after a zero byte: no file
  a.bytes = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + count);
  return a;
}

bool is_trusted(int socket) {
  ucred peer{};
  socklen_t size = sizeof peer;
  return ::getsockopt(socket, SOL_SOCKET, SO_PEERCRED, &peer, &size) == 0 &&
         (peer.uid == ::geteuid() || peer.uid == 0);
}

[[noreturn]] void fail(int socket, const std::string& what) {
  if (socket >= 0) ::close(socket);
  throw std::runtime_error(what);
}

std::string silent(const std::string& surface) {
  return "the bridge of surface '" + surface + "' does not answer";
}

// Returns the socket on which receive_answer() awaits the answer.
int send_command(const std::string& surface, const std::string& command) {
  const int socket = ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
  // A suspended bridge accepts no more connections than its queue takes.
  const timeval patience{.tv_sec = 1, .tv_usec = 0};
  const Address a = address_of(surface);
  if (socket < 0 || ::setsockopt(socket, SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof patience) != 0 ||
      ::connect(socket, reinterpret_cast<const sockaddr*>(&a.at), a.bytes) != 0)
    fail(socket, errno == EAGAIN ? silent(surface) : "no bridge serves surface '" + surface + "'");
  if (!is_trusted(socket))
    fail(socket, "another user's program listens in place of the bridge of surface '" + surface + "'");
  if (::send(socket, command.data(), command.size(), MSG_NOSIGNAL) < 0)
    fail(socket, "the bridge of surface '" + surface + "' has ended");
  return socket;
}

std::string receive_answer(const std::string& surface, int socket, std::chrono::milliseconds patience) {
  pollfd ready{socket, POLLIN, 0};
  // An answer is either here by then or fails to be sent.
  if (::poll(&ready, 1, static_cast<int>(patience.count())) != 1) ::shutdown(socket, SHUT_RD);
  std::string text(kMaxAnswer, '\0');
  const ssize_t got = ::recv(socket, text.data(), text.size(), 0);
  if (got < 0) fail(socket, silent(surface) + ": " + std::strerror(errno));
  if (got == 0) fail(socket, silent(surface));
  ::close(socket);
  text.resize(got);
  return text;
}

// The surfaces whose bridges listen.
std::set<std::string> served_surfaces() {
  const std::string prefix = " @" + name_of("");
  std::set<std::string> surfaces;
  std::ifstream sockets("/proc/net/unix");
  for (std::string line; std::getline(sockets, line);)
    if (const std::size_t at = line.find(prefix); at != std::string::npos)
      surfaces.insert(line.substr(at + prefix.size()));
  return surfaces;
}

}  // namespace

ControlSocket::ControlSocket(const std::string& surface)
    : listener_(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK | SOCK_CLOEXEC, 0)) {
  const Address a = address_of(surface);
  if (listener_ < 0 || ::bind(listener_, reinterpret_cast<const sockaddr*>(&a.at), a.bytes) != 0 ||
      ::listen(listener_, 8) != 0) {
    const int error = errno;
    if (listener_ >= 0) ::close(listener_);
    throw std::runtime_error("cannot listen for commands to surface '" + surface +
                             "': " + std::strerror(error));
  }
}

ControlSocket::~ControlSocket() {
  for (const int client : clients_) ::close(client);
  ::close(listener_);
}

void ControlSocket::serve(const std::function<ControlAnswer(const std::string&)>& answer) {
  // Bounded: a client that keeps connecting holds up no tick.
  for (std::size_t i = 0; i < kMaxClients; ++i) {
    const int client = ::accept4(listener_, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (client < 0) break;
    if (!is_trusted(client)) {
      ::close(client);
      continue;
    }
    // Clients that ask nothing must not keep an emergency stop out.
    if (clients_.size() == kMaxClients) {
      ::close(clients_.front());
      clients_.erase(clients_.begin());
    }
    clients_.push_back(client);
  }
  for (std::size_t i = 0; i < clients_.size();) {
    std::array<char, 256> command;
    const ssize_t got = ::recv(clients_[i], command.data(), command.size(), 0);
    if (got < 0 && (errno == EAGAIN || errno == EINTR)) {
      ++i;
      continue;
    }
    if (got > 0) {
      const ControlAnswer reply = answer(std::string(command.data(), got));
      const std::size_t bytes = std::min(reply.text.size(), kMaxAnswer);
      // Fails if the other end has closed or shut down, whether before or at this moment.
      if (::send(clients_[i], reply.text.data(), bytes, MSG_NOSIGNAL) >= 0 && reply.then) reply.then();
    }
    ::close(clients_[i]);
    clients_.erase(clients_.begin() + i);
  }
}

std::string ask_bridge(const std::string& surface, const std::string& command,
                       std::chrono::milliseconds patience) {
  return receive_answer(surface, send_command(surface, command), patience);
}

std::string stop_all_bridges() {
  std::vector<std::pair<std::string, int>> told;
  std::string stopped, failed;
  for (const std::string& surface : served_surfaces()) try {
      told.emplace_back(surface, send_command(surface, "stop"));
    } catch (const std::runtime_error& e) {
      failed += "; " + std::string(e.what());
    }
  for (const auto& [surface, socket] : told) try {
      receive_answer(surface, socket, 1s);
      stopped += (stopped.empty() ? "'" : ", '") + surface + "'";
    } catch (const std::runtime_error& e) {
      failed += "; " + std::string(e.what());
    }
  if (told.empty() && failed.empty()) return "No emergency stop: no bridge runs here.";
  return (stopped.empty() ? "No emergency stop"
                          : "Emergency stop of " + stopped + "; 'surface_bridge arm NAME' releases it") +
         failed + ".";
}

}  // namespace hardware

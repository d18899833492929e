// Kernel transports: a Unix socket, and Boost's message_queue.
#include <sys/socket.h>

#include <boost/interprocess/ipc/message_queue.hpp>
#include <cstdlib>
#include <string>

#include "RoundTrip.h"

namespace bench {
namespace {

void send_all(int socket, std::span<const float> values) {
  const char* at = reinterpret_cast<const char*>(values.data());
  for (std::size_t left = values.size_bytes(); left > 0;) {
    const ssize_t sent = ::send(socket, at, left, MSG_NOSIGNAL);
    if (sent <= 0) std::_Exit(1);
    at += sent, left -= static_cast<std::size_t>(sent);
  }
}

void receive_all(int socket, std::span<float> values) {
  char* at = reinterpret_cast<char*>(values.data());
  for (std::size_t left = values.size_bytes(); left > 0;) {
    const ssize_t got = ::recv(socket, at, left, 0);
    if (got <= 0) std::_Exit(1);
    at += got, left -= static_cast<std::size_t>(got);
  }
}

}  // namespace

Figures unix_socket(const Case& c, int peer_cpu) {
  int pair[2];
  if (::socketpair(AF_UNIX, SOCK_STREAM, 0, pair) != 0) std::abort();
  std::vector<float> there(std::size_t{c.side} * c.side), back(there.size());
  const pid_t peer = start_peer(peer_cpu, [&] {
    for (int i = 1;; ++i) {
      receive_all(pair[1], there);
      consume(there);
      produce(back, i);
      send_all(pair[1], back);
    }
  });
  const Figures figures = measure(c.rounds, [&](int i) {
    produce(there, i);
    send_all(pair[0], there);
    receive_all(pair[0], back);
    consume(back);
  });
  ::kill(peer, SIGKILL);
  ::waitpid(peer, nullptr, 0);
  ::close(pair[0]);
  ::close(pair[1]);
  return figures;
}

Figures message_queue(const Case& c, int peer_cpu) {
  namespace bip = boost::interprocess;
  std::vector<float> there(std::size_t{c.side} * c.side), back(there.size());
  const std::size_t bytes = there.size() * sizeof(float);
  const std::string name = "bench-queue-" + std::to_string(::getpid());
  bip::message_queue forth(bip::create_only, (name + "-forth").c_str(), 2, bytes);
  bip::message_queue home(bip::create_only, (name + "-home").c_str(), 2, bytes);
  const auto receive = [bytes](bip::message_queue& from, std::vector<float>& to) {
    bip::message_queue::size_type got = 0;
    unsigned priority = 0;
    from.receive(to.data(), bytes, got, priority);
  };
  const pid_t peer = start_peer(peer_cpu, [&] {
    for (int i = 1;; ++i) {
      receive(forth, there);
      consume(there);
      produce(back, i);
      home.send(back.data(), bytes, 0);
    }
  });
  const Figures figures = measure(c.rounds, [&](int i) {
    produce(there, i);
    forth.send(there.data(), bytes, 0);
    receive(home, back);
    consume(back);
  });
  ::kill(peer, SIGKILL);
  ::waitpid(peer, nullptr, 0);
  bip::message_queue::remove((name + "-forth").c_str());
  bip::message_queue::remove((name + "-home").c_str());
  return figures;
}

}  // namespace bench

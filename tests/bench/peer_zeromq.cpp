// ZeroMQ: two PAIR sockets over its ipc transport.
#include "RoundTrip.h"

#ifdef BENCH_ZEROMQ
#include <zmq.h>

#include <cstdlib>
#include <string>

namespace bench {

const char* zeromq_unavailable() { return nullptr; }

Figures zeromq(const Case& c, int peer_cpu) {
  std::vector<float> there(std::size_t{c.side} * c.side), back(there.size());
  const std::size_t bytes = there.size() * sizeof(float);
  const std::string address = "ipc:///tmp/smartsurf-bench-" + std::to_string(::getpid());
  const auto require = [](bool good) {
    if (!good) std::_Exit(1);
  };
  const auto send = [&](void* socket, const std::vector<float>& from) {
    require(::zmq_send(socket, from.data(), bytes, 0) == static_cast<int>(bytes));
  };
  const auto receive = [&](void* socket, std::vector<float>& to) {
    require(::zmq_recv(socket, to.data(), bytes, 0) == static_cast<int>(bytes));
  };
  // The peer creates its own context, because a context does not survive fork().
  const pid_t peer = start_peer(peer_cpu, [&] {
    void* context = ::zmq_ctx_new();
    void* socket = ::zmq_socket(context, ZMQ_PAIR);
    require(::zmq_connect(socket, address.c_str()) == 0);
    for (int i = 1;; ++i) {
      receive(socket, there);
      consume(there);
      produce(back, i);
      send(socket, back);
    }
  });
  void* context = ::zmq_ctx_new();
  void* socket = ::zmq_socket(context, ZMQ_PAIR);
  require(::zmq_bind(socket, address.c_str()) == 0);
  const Figures figures = measure(c.rounds, [&](int i) {
    produce(there, i);
    send(socket, there);
    receive(socket, back);
    consume(back);
  });
  ::kill(peer, SIGKILL);
  ::waitpid(peer, nullptr, 0);
  const int linger = 0;
  ::zmq_setsockopt(socket, ZMQ_LINGER, &linger, sizeof linger);
  ::zmq_close(socket);
  ::zmq_ctx_term(context);
  ::unlink(address.c_str() + sizeof "ipc://" - 1);
  return figures;
}

}  // namespace bench
#else
namespace bench {
const char* zeromq_unavailable() { return "libzmq3-dev is not installed"; }
Figures zeromq(const Case&, int) { return {}; }
}  // namespace bench
#endif

#include "common/confine/Broker.h"

#include <pthread.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <stdexcept>
#include <string>

#include "common/error/UserError.h"
#include "common/files/UnfinishedFile.h"

namespace common {
namespace {

constexpr std::uint32_t kEnd = UINT32_MAX;

struct Reply {
  enum Kind : std::int32_t { kDone, kUserError, kFailure } kind = kDone;
  std::int32_t value = 0;
  char text[1024] = {};
};

void set_failure(Reply& reply, Reply::Kind kind, const char* text) noexcept {
  reply.kind = kind;
  std::strncpy(reply.text, text, sizeof reply.text - 1);
}

Reply run(const Broker::Service& service) noexcept {
  Reply reply;
  try {
    reply.value = service();
  } catch (const UserError& error) {
    set_failure(reply, Reply::kUserError, error.what());
  } catch (const std::exception& error) {
    set_failure(reply, Reply::kFailure, error.what());
  }
  return reply;
}

ssize_t receive(int socket, void* bytes, std::size_t size) noexcept {
  ssize_t n = 0;
  while ((n = ::recv(socket, bytes, size, 0)) < 0 && errno == EINTR) {
  }
  return n;
}

[[noreturn]] void refuse(int error) {
  throw std::runtime_error(std::string("the process cannot be confined: ") + std::strerror(error));
}

[[noreturn]] void throw_ended() { throw std::runtime_error("the process that names the outputs has ended"); }

// Serves until the other process ends or asks to end, and returns whether it asked.
bool serve(int socket, const std::vector<Broker::Service>& services) noexcept {
  std::uint32_t asked = 0;
  while (receive(socket, &asked, sizeof asked) == sizeof asked && asked != kEnd) {
    Reply reply;
    if (asked < services.size())
      reply = run(services[asked]);
    else
      set_failure(reply, Reply::kFailure, "there is no such service");
    if (::send(socket, &reply, sizeof reply, MSG_NOSIGNAL) < 0) break;
  }
  return asked == kEnd;
}

std::atomic<int> emergency_socket{-1};
std::atomic<pid_t> emergency_owner{0};  // not its forked children

// The broker closes its end when all is done.
void end_by_emergency() noexcept {
  if (emergency_owner.load() != ::getpid()) return;
  const int socket = emergency_socket.exchange(-1);
  if (socket < 0) return;
  const std::uint32_t end = kEnd;
  Reply reply;
  if (::send(socket, &end, sizeof end, MSG_NOSIGNAL) == sizeof end)
    while (receive(socket, &reply, sizeof reply) > 0) {
    }
}

void set_emergency_socket(int socket) noexcept {
  emergency_socket.store(socket);
  emergency_owner.store(::getpid());
  at_removal_of_unfinished_files(end_by_emergency);
}

}  // namespace

SignalsDeferred::SignalsDeferred() noexcept {
  sigset_t signals;
  ::sigemptyset(&signals);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGXCPU}) ::sigaddset(&signals, signal);
  ::pthread_sigmask(SIG_BLOCK, &signals, &before_);
}

SignalsDeferred::~SignalsDeferred() { ::pthread_sigmask(SIG_SETMASK, &before_, nullptr); }

Broker::Broker(std::vector<Service> services, AtEnd at_end) {
  int ends[2];
  if (::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends) != 0) refuse(errno);
  const auto [here, there] = ends;
  socket_ = here;
  {
    const SignalsDeferred deferred;
    process_ = ::fork();
    if (process_ == 0) {
      ::close(here);
      ::unsetenv("SMARTSURF_PARENT");  // it is not the parent of what this process starts
      at_end(serve(there, services));
      ::_exit(0);  // the other process waits for the socket to close, which means that all is done
    }
  }
  const int failure = errno;
  ::close(there);
  if (process_ < 0) {
    ::close(here);
    refuse(failure);
  }
  set_emergency_socket(socket_);
}

Broker::~Broker() {
  end_by_emergency();
  at_removal_of_unfinished_files(nullptr);
  ::close(socket_);
  while (process_ > 0 && ::waitpid(process_, nullptr, 0) < 0 && errno == EINTR) {
  }
}

void Broker::require() {
  char byte = 0;
  if (::recv(socket_, &byte, sizeof byte, MSG_PEEK | MSG_DONTWAIT) == 0) throw_ended();
}

int Broker::ask(std::size_t service) {
  const std::lock_guard lock(mutex_);
  const auto number = static_cast<std::uint32_t>(service);
  Reply reply;
  if (::send(socket_, &number, sizeof number, MSG_NOSIGNAL) != sizeof number ||
      receive(socket_, &reply, sizeof reply) != sizeof reply)
    throw_ended();
  reply.text[sizeof reply.text - 1] = '\0';
  if (reply.kind == Reply::kUserError) throw UserError(reply.text);
  if (reply.kind == Reply::kFailure) throw std::runtime_error(reply.text);
  return reply.value;
}

}  // namespace common

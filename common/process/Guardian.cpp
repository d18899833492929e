#include "common/process/Guardian.h"

#include <poll.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>

namespace common {
namespace {

// Returns whether the process has ended without a dismissal. A pidfd is readable once all its threads, and
// with them its files and locks, are gone.
bool await_end(int process, int dismissal) noexcept {
  pollfd events[] = {{process, POLLIN, 0}, {dismissal, POLLIN, 0}};
  while (::poll(events, 2, -1) < 0 && errno == EINTR) {
  }
  char byte = 0;
  if (events[1].revents != 0 && ::recv(dismissal, &byte, 1, 0) == 1) return false;
  while (::poll(events, 1, -1) < 0 && errno == EINTR) {  // its end of the socket may be gone first
  }
  return true;
}

[[noreturn]] void guard(int process, int dismissal, const std::function<void()>& clean) noexcept {
  sigset_t all;
  ::sigfillset(&all);
  ::sigprocmask(SIG_SETMASK, &all, nullptr);
  ::setsid();
  // The readers of that process's output wait for its end alone.
  const auto low = static_cast<unsigned>(std::min(process, dismissal)),
             high = static_cast<unsigned>(std::max(process, dismissal));
  if (low > 0) ::close_range(0, low - 1, 0);
  if (high > low + 1) ::close_range(low + 1, high - 1, 0);
  ::close_range(high + 1, ~0U, 0);
  if (await_end(process, dismissal)) clean();
  ::_exit(0);
}

}  // namespace

Guardian::Guardian(const std::function<void()>& clean) noexcept {
  int ends[2];
  if (::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends) != 0) return;
  const auto self = static_cast<int>(::syscall(SYS_pidfd_open, ::getpid(), 0));
  if (self >= 0) {
    process_ = ::fork();
    if (process_ == 0) guard(self, ends[0], clean);
    ::close(self);
  }
  ::close(ends[0]);
  if (process_ < 0)
    ::close(ends[1]);
  else
    dismissal_ = ends[1];
}

Guardian::~Guardian() {
  if (process_ < 0) return;
  ::send(dismissal_, "", 1, MSG_NOSIGNAL);
  ::close(dismissal_);
  while (::waitpid(process_, nullptr, 0) < 0 && errno == EINTR) {
  }
}

}  // namespace common

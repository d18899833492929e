#include "common/process/ParentWatch.h"

#include <poll.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <system_error>
#include <thread>

namespace common {
namespace {

void end_this_process() noexcept {
  ::kill(::getpid(), SIGTERM);
  std::this_thread::sleep_for(std::chrono::seconds(1));
  ::kill(::getpid(), SIGTERM);
}

}  // namespace

void watch_parent() noexcept {
  const char* const text = std::getenv("SMARTSURF_PARENT");
  if (text == nullptr) return;
  pid_t parent = 0;
  std::from_chars(text, text + std::strlen(text), parent);
  ::unsetenv("SMARTSURF_PARENT");  // it is not the parent of this program's children
  if (parent <= 1) return;
  const auto handle = static_cast<int>(::syscall(SYS_pidfd_open, parent, 0));
  if (handle < 0 && errno != ESRCH) {  // a kernel older than 5.3
    ::prctl(PR_SET_PDEATHSIG, SIGTERM);
    if (::getppid() != parent) end_this_process();
    return;
  }
  try {
    std::thread([handle] {
      pollfd ended{.fd = handle, .events = POLLIN, .revents = 0};
      while (handle >= 0 && ::poll(&ended, 1, -1) < 0) {
      }
      end_this_process();
    }).detach();
  } catch (const std::system_error&) {  // the system refuses a thread
    ::prctl(PR_SET_PDEATHSIG, SIGTERM);
  }
}

}  // namespace common

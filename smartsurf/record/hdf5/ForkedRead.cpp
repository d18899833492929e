#include "smartsurf/record/hdf5/ForkedRead.h"

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>

namespace smartsurf::record {
namespace {

constexpr unsigned kChildTimeout_s = 60;

[[noreturn]] void run_in_child(const std::function<void()>& action) {
  // The parent's handlers must not run in the child.
  for (const int signal : {SIGSEGV, SIGBUS, SIGABRT, SIGFPE, SIGILL, SIGALRM}) std::signal(signal, SIG_DFL);
  if (const int null_device = ::open("/dev/null", O_WRONLY); null_device >= 0) {
    ::dup2(null_device, STDOUT_FILENO);
    ::dup2(null_device, STDERR_FILENO);
  }
  ::alarm(kChildTimeout_s);
  try {
    action();
  } catch (...) {  // the parent will get the same exception and reports it
  }
  ::_exit(0);
}

}  // namespace

bool completes_in_child(const std::function<void()>& action) {
  const pid_t child = ::fork();
  if (child < 0) return true;
  if (child == 0) run_in_child(action);
  int status = 0;
  while (::waitpid(child, &status, 0) < 0)
    if (errno != EINTR) return true;
  return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

}  // namespace smartsurf::record

#include "smartsurf/mesh/ChildProcess.h"

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <exception>

namespace smartsurf::mesh {
namespace {

bool write_all(int fd, const std::string& bytes) {
  for (std::size_t done = 0; done < bytes.size();) {
    const ssize_t n = ::write(fd, bytes.data() + done, bytes.size() - done);
    if (n < 0 && errno != EINTR) return false;
    if (n > 0) done += static_cast<std::size_t>(n);
  }
  return true;
}

[[noreturn]] void run_child(const std::function<std::string()>& task, double cpu_s, int fd) {
  // Do not inherit the parent's signal handlers.
  for (const int signal : {SIGSEGV, SIGBUS, SIGABRT, SIGFPE, SIGILL, SIGPROF, SIGTERM, SIGINT})
    std::signal(signal, SIG_DFL);
  const rlimit no_core{0, 0};
  ::setrlimit(RLIMIT_CORE, &no_core);
  const auto whole_s = static_cast<time_t>(cpu_s);
  const itimerval once{{0, 0},
                       {whole_s, static_cast<suseconds_t>(1e6 * (cpu_s - static_cast<double>(whole_s)))}};
  ::setitimer(ITIMER_PROF, &once, nullptr);
  if (const int nowhere = ::open("/dev/null", O_WRONLY); nowhere >= 0) {
    ::dup2(nowhere, STDOUT_FILENO);
    ::dup2(nowhere, STDERR_FILENO);
  }
  try {
    ::_exit(write_all(fd, task()) ? 0 : 1);
  } catch (...) {
    ::_exit(1);
  }
}

std::string read_all(int fd) {
  std::string bytes;
  char block[65536];
  while (true) {
    const ssize_t n = ::read(fd, block, sizeof block);
    if (n > 0)
      bytes.append(block, static_cast<std::size_t>(n));
    else if (n == 0 || errno != EINTR)
      return bytes;
  }
}

}  // namespace

std::optional<std::string> run_in_child_process(const std::function<std::string()>& task, double cpu_s) {
  int pipe_fds[2];
  if (::pipe2(pipe_fds, O_CLOEXEC) != 0) return task();
  const pid_t child = ::fork();
  if (child == 0) run_child(task, cpu_s, pipe_fds[1]);
  ::close(pipe_fds[1]);
  if (child < 0) {
    ::close(pipe_fds[0]);
    return task();
  }
  std::string bytes = read_all(pipe_fds[0]);
  ::close(pipe_fds[0]);
  int status = 0;
  while (::waitpid(child, &status, 0) < 0)
    if (errno != EINTR) return std::nullopt;
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) return std::nullopt;
  return bytes;
}

}  // namespace smartsurf::mesh

#include "common/process/ChildWork.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <exception>
#include <new>
#include <stdexcept>

#include "common/confine/Confinement.h"
#include "common/error/UserError.h"
#include "common/process/StopSignals.h"

namespace common {
namespace {

constexpr int kStopInterval_ms = 50;
constexpr int kNoMemory = 3, kRefused = 4;  // exit statuses of the child
constexpr int kResult = STDERR_FILENO + 1;  // its pipe

thread_local double children_s = 0.0;

bool write_all(int fd, const std::string& bytes) {
  for (std::size_t done = 0; done < bytes.size();) {
    const ssize_t n = ::write(fd, bytes.data() + done, bytes.size() - done);
    if (n < 0 && errno != EINTR) return false;
    if (n > 0) done += n;
  }
  return true;
}

// A limit that cannot be set. SMARTSURF_CONFINE=off does without.
void refuse_unlimited(const std::string& what) {
  if (confinement_mode() == ConfinementMode::kOff) return;
  throw UserError("a file of unknown origin is read within limits of memory and processor time, and " + what +
                  ": " + std::strerror(errno));
}

// The bytes that the process has mapped, which count towards its limit; RLIM_INFINITY: unknown.
rlim_t mapped_bytes() {
  unsigned long long pages = 0;
  errno = 0;
  std::FILE* const file = std::fopen("/proc/self/statm", "re");
  const bool known = file != nullptr && std::fscanf(file, "%llu", &pages) == 1;
  if (file != nullptr) std::fclose(file);
  if (known) return static_cast<rlim_t>(pages) * static_cast<rlim_t>(::sysconf(_SC_PAGESIZE));
  refuse_unlimited("/proc/self/statm, which tells the memory in use, cannot be read");
  return RLIM_INFINITY;
}

// The hard limit is larger by `grace`.
void limit(__rlimit_resource resource, rlim_t value, rlim_t grace = 0) {
  rlimit now{};
  if (::getrlimit(resource, &now) == 0) {
    now.rlim_max = std::min(now.rlim_max, value + grace);
    now.rlim_cur = std::min({now.rlim_cur, now.rlim_max, value});  // RLIM_INFINITY is the largest number
    if (::setrlimit(resource, &now) == 0) return;
  }
  refuse_unlimited("the system refuses to set them");
}

void limit_memory(rlim_t mapped, std::size_t bytes) {
  if (mapped != RLIM_INFINITY) limit(RLIMIT_AS, mapped + bytes);
}

void confine_child(const ChildLimits& limits, rlim_t mapped) {
  limit(RLIMIT_CORE, 0);
  limit_memory(mapped, limits.memory_bytes);
  limit_processor_time(limits.cpu_s);
  Confinement confinement;
  confinement.read = limits.readable;
  add_system_files(confinement);
  confine(confinement);
}

[[noreturn]] void run_child(const std::function<std::string()>& work, const ChildLimits& limits, int fd,
                            pid_t parent, rlim_t mapped) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent) ::_exit(1);
  // Do not inherit the parent's signal handlers.
  for (const int signal :
       {SIGSEGV, SIGBUS, SIGABRT, SIGFPE, SIGILL, SIGPROF, SIGTERM, SIGINT, SIGHUP, SIGXCPU, SIGALRM})
    std::signal(signal, SIG_DFL);
  ::dup2(fd, kResult);  // the only descriptor that stays besides the streams
  ::close_range(kResult + 1, ~0U, 0);
  if (const int nowhere = ::open("/dev/null", O_RDWR); nowhere >= 0)
    for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) ::dup2(nowhere, stream);
  try {
    try {
      confine_child(limits, mapped);
    } catch (const std::runtime_error& error) {
      write_all(kResult, error.what());
      ::_exit(kRefused);
    }
    ::_exit(write_all(kResult, work()) ? 0 : 1);
  } catch (const std::bad_alloc&) {
    ::_exit(kNoMemory);
  } catch (...) {
    ::_exit(1);
  }
}

// Returns whether the child closed the pipe before the stop flag was raised, with no more than so many bytes.
bool read_until_stop(int fd, std::size_t most_bytes, std::string& bytes) {
  char block[65536];
  while (!stop_flag().load(std::memory_order_relaxed) && bytes.size() <= most_bytes) {
    pollfd readable{.fd = fd, .events = POLLIN, .revents = 0};
    if (::poll(&readable, 1, kStopInterval_ms) <= 0) continue;
    const ssize_t n = ::read(fd, block, sizeof block);
    if (n > 0)
      bytes.append(block, n);
    else if (n == 0 || errno != EINTR)
      return true;
  }
  return false;
}

double seconds(const timeval& time) {
  return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
}

double processor_time_s(const rusage& used) { return seconds(used.ru_utime) + seconds(used.ru_stime); }

}  // namespace

ChildResult run_in_child(const std::function<std::string()>& work, const ChildLimits& limits) {
  const rlim_t mapped = mapped_bytes();
  int pipe_fds[2];
  const auto refuse = [] {
    throw std::runtime_error(
        std::string("a file of unknown origin needs a process of its own, and there is none: ") +
        std::strerror(errno));
  };
  if (::pipe2(pipe_fds, O_CLOEXEC) != 0) refuse();
  const pid_t parent = ::getpid(), child = ::fork();
  if (child == 0) run_child(work, limits, pipe_fds[1], parent, mapped);
  ::close(pipe_fds[1]);
  if (child < 0) {
    const int failure = errno;
    ::close(pipe_fds[0]);
    errno = failure;
    refuse();
  }
  ChildResult result{};
  bool ended = false;
  try {
    ended = read_until_stop(pipe_fds[0], limits.answer_bytes, result.bytes);
  } catch (const std::bad_alloc&) {
  }
  ::close(pipe_fds[0]);
  if (!ended) ::kill(child, SIGKILL);
  int status = 0;
  rusage used{};
  while (::wait4(child, &status, 0, &used) < 0 && errno == EINTR) {
  }
  children_s += processor_time_s(used);
  const bool out_of_time = ended && ran_out_of_time(status, used, limits.cpu_s);
  const int exit_status = ended && WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  if (exit_status == kRefused) throw UserError(result.bytes);
  result.end = exit_status == 0                              ? ChildResult::End::kReturned
               : exit_status == kNoMemory                    ? ChildResult::End::kOutOfMemory
               : out_of_time                                 ? ChildResult::End::kOutOfTime
               : stop_flag().load(std::memory_order_relaxed) ? ChildResult::End::kStopped
                                                             : ChildResult::End::kFailed;
  return result;
}

void limit_address_space(std::size_t bytes) { limit_memory(mapped_bytes(), bytes); }

void limit_processor_time(double seconds) {
  const auto whole_s = static_cast<time_t>(seconds);
  const itimerval once{{0, 0},
                       {whole_s, static_cast<suseconds_t>(1e6 * (seconds - static_cast<double>(whole_s)))}};
  ::setitimer(ITIMER_PROF, &once, nullptr);
  limit(RLIMIT_CPU, static_cast<rlim_t>(std::ceil(seconds)), 1);
}

bool ran_out_of_time(int status, const rusage& used, double seconds) noexcept {
  if (!WIFSIGNALED(status)) return false;
  const int signal = WTERMSIG(status);
  return signal == SIGPROF || ((signal == SIGXCPU || signal == SIGKILL) && processor_time_s(used) >= seconds);
}

double child_time_s() noexcept { return children_s; }

}  // namespace common

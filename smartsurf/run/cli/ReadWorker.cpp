#include "smartsurf/run/cli/ReadWorker.h"

#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <stdexcept>

#include "smartsurf/run/cli/CommandLine.h"
#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::run {
namespace {

std::atomic<pid_t> worker{0};

extern "C" void pass_on(int signal) {
  const int failure = errno;
  ::kill(worker.load(), signal);
  errno = failure;
}

// Passes stop signals on to the worker while it lives; an ignored SIGHUP (nohup) stays ignored.
class PassingOn {
 public:
  explicit PassingOn(pid_t child) {
    worker.store(child);
    struct sigaction action {};
    action.sa_handler = pass_on;
    for (int i = 0; i < 3; ++i) {
      ::sigaction(kSignals[i], nullptr, &before_[i]);
      if (before_[i].sa_handler != SIG_IGN) ::sigaction(kSignals[i], &action, nullptr);
    }
  }
  ~PassingOn() {
    for (int i = 0; i < 3; ++i) ::sigaction(kSignals[i], &before_[i], nullptr);
  }
  PassingOn(const PassingOn&) = delete;
  PassingOn& operator=(const PassingOn&) = delete;

 private:
  static constexpr int kSignals[] = {SIGINT, SIGTERM, SIGHUP};
  struct sigaction before_[3] = {};
};

}  // namespace

int read_in_worker(const std::string& recording, const std::function<int()>& command) {
  const pid_t parent = ::getpid(), child = ::fork();
  if (child < 0)
    throw std::runtime_error(recording +
                             ": is read by a process of its own, and there is none: " + std::strerror(errno));
  if (child == 0) {
    ::prctl(PR_SET_PDEATHSIG, SIGTERM);
    if (::getppid() != parent) ::_exit(1);
    ::_exit(run_and_report(command));
  }
  const PassingOn passing_on(child);
  int status = 0;
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (WIFEXITED(status)) return WEXITSTATUS(status);
  const int signal = WTERMSIG(status);
  if (signal == SIGSEGV || signal == SIGBUS || signal == SIGABRT || signal == SIGFPE || signal == SIGILL)
    throw scene::InputError(recording + ": is damaged: the HDF5 library cannot read it");
  return 128 + signal;
}

}  // namespace smartsurf::run

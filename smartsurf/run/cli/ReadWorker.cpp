#include "smartsurf/run/cli/ReadWorker.h"

#include <fmt/format.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "common/confine/OutputServices.h"
#include "common/process/ChildWork.h"
#include "common/process/ParentWatch.h"
#include "smartsurf/record/Recording.h"
#include "smartsurf/run/cli/CommandLine.h"
#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::run {
namespace {

std::atomic<pid_t> worker{0};

extern "C" void pass_on(int signal) {
  const int failure = errno;
  if (const pid_t process = worker.load(); process > 0) ::kill(process, signal);
  errno = failure;
}

// Passes stop signals on to the worker while it lives; an ignored SIGHUP (nohup) stays ignored.
class PassingOn {
 public:
  explicit PassingOn(pid_t child) {
    worker.store(child);
    struct sigaction action {};
    action.sa_handler = pass_on;
    for (std::size_t i = 0; i < kSignals.size(); ++i) {
      ::sigaction(kSignals[i], nullptr, &before_[i]);
      if (before_[i].sa_handler != SIG_IGN) ::sigaction(kSignals[i], &action, nullptr);
    }
  }
  ~PassingOn() {
    for (std::size_t i = 0; i < kSignals.size(); ++i) ::sigaction(kSignals[i], &before_[i], nullptr);
  }
  PassingOn(const PassingOn&) = delete;
  PassingOn& operator=(const PassingOn&) = delete;

 private:
  static constexpr std::array kSignals{SIGINT, SIGTERM, SIGHUP, SIGXCPU};
  std::array<struct sigaction, kSignals.size()> before_{};
};

int run_worker(const ReadJob& job, std::vector<common::PreparedOutput> outputs, pid_t parent, double time_s) {
  std::optional<common::Broker> broker;
  if (!outputs.empty()) {
    broker.emplace(common::output_services(outputs), [&](bool) { common::remove_unnamed(outputs); });
    common::use_outputs_of(*broker, outputs);
  }
  if (job.prepare) job.prepare();
  if (job.confinement) {
    common::Confinement confinement = *job.confinement;
    if (confinement.calls == common::Confinement::Calls::kReader)
      confinement.calls = common::Confinement::Calls::kSimulator;
    common::add_system_files(confinement);
    confinement.read.emplace_back(job.recording);
    common::add_outputs(confinement, outputs);
    common::confine(confinement);
  }
  // A command that catches signals ends with the parent, whether or not it hears the first one.
  ::setenv("SMARTSURF_PARENT", std::to_string(parent).c_str(), 1);
  if (job.only_reads) {
    common::limit_address_space(record::memory_to_read(job.recording));
    common::limit_processor_time(time_s);
  }
  const int status = job.command();
  common::use_prepared_outputs({}, {});
  return status;
}

// Waits until what a worker that was killed has left has ended, too: it removes files.
void await_remains() {
  constexpr int kLongest_ms = 1000;
  for (int i = 0; i < kLongest_ms; ++i) {
    const pid_t ended = ::waitpid(-1, nullptr, WNOHANG);
    if (ended < 0 && errno != EINTR) return;
    if (ended == 0) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
}

// Removes the parts that got no name.
class Parts {
 public:
  explicit Parts(const std::vector<common::PreparedOutput>& outputs) : outputs_(outputs) {}
  ~Parts() { common::remove_unnamed(outputs_); }
  Parts(const Parts&) = delete;
  Parts& operator=(const Parts&) = delete;

 private:
  const std::vector<common::PreparedOutput>& outputs_;
};

}  // namespace

int read_in_worker(const ReadJob& job) {
  // A signal must neither leave an output's part nor miss the worker.
  std::optional<common::SignalsDeferred> deferred(std::in_place);
  const std::vector<common::PreparedOutput> outputs =
      job.prepare_outputs ? job.prepare_outputs() : std::vector<common::PreparedOutput>();
  const Parts parts(outputs);
  const double time_s = record::time_to_read_s(job.recording);
  ::prctl(PR_SET_CHILD_SUBREAPER, 1);
  const pid_t parent = ::getpid(), child = ::fork();
  if (child < 0)
    throw std::runtime_error(job.recording +
                             ": is read by a process of its own, and there is none: " + std::strerror(errno));
  if (child == 0) {
    ::prctl(PR_SET_PDEATHSIG, SIGTERM);
    if (::getppid() != parent) ::_exit(1);
    deferred.reset();
    ::_exit(run_and_report([&] { return run_worker(job, outputs, parent, time_s); }));
  }
  const PassingOn passing_on(child);
  deferred.reset();
  common::watch_parent();
  int status = 0;
  rusage used{};
  while (::wait4(child, &status, 0, &used) < 0 && errno == EINTR) {
  }
  worker.store(0);
  if (WIFSIGNALED(status) || WEXITSTATUS(status) > 128) await_remains();
  if (WIFEXITED(status)) return WEXITSTATUS(status);
  const int signal = WTERMSIG(status);
  for (const int crash : {SIGSEGV, SIGBUS, SIGABRT, SIGFPE, SIGILL, SIGSYS})
    if (signal == crash)
      throw scene::InputError(job.recording + ": cannot be read: its reader has crashed (" +
                              ::strsignal(signal) + ")");
  if (job.only_reads && common::ran_out_of_time(status, used, time_s))
    throw scene::InputError(
        fmt::format("{}: needs more than {:.0f} s of processor time, the most that a reader of a "
                    "file of this size may have",
                    job.recording, time_s));
  return 128 + signal;
}

}  // namespace smartsurf::run

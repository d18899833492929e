#include "common/process/Supervisor.h"

#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <string>
#include <system_error>
#include <vector>

namespace common {
namespace {

using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

constexpr auto kGrace = 1500ms, kGraceWithoutParent = 300ms;  // ControllerProcess sends SIGKILL after 2 s
constexpr auto kLongest = 5s;  // a process that waits for a broken disk cannot be killed
constexpr timespec kPoll{0, 10'000'000};
constexpr int kCannotStart = 2;

// The parent of a process, by /proc/PID/stat; 0: unknown. The name before it may hold any characters.
pid_t parent_of(const std::filesystem::path& folder) {
  std::ifstream file(folder / "stat");
  const std::string text((std::istreambuf_iterator<char>(file)), {});
  const std::size_t end_of_name = text.rfind(')');  // then " S 123 …"
  pid_t parent = 0;
  if (end_of_name != std::string::npos && end_of_name + 4 < text.size())
    std::from_chars(text.data() + end_of_name + 4, text.data() + text.size(), parent);
  return parent;
}

// Children of this process alone: the numbers of others may have passed on to other processes when a signal
// reaches them. What a child leaves when it ends becomes a child of this process. Empty without /proc.
std::vector<pid_t> children() {
  std::vector<pid_t> all;
  std::error_code error;
  auto entry = std::filesystem::directory_iterator("/proc", error);
  for (; entry != std::filesystem::directory_iterator(); entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    pid_t process = 0;
    const auto [end, failure] = std::from_chars(name.data(), name.data() + name.size(), process);
    if (failure == std::errc() && end == name.data() + name.size() && parent_of(entry->path()) == getpid())
      all.push_back(process);
  }
  return all;
}

class Supervisor {
 public:
  Supervisor(pid_t parent, pid_t command) : parent_(parent), command_(command) {}

  // Returns the exit status once no process is left.
  int run(const sigset_t& awaited) {
    for (;;) {
      const bool any_left = reap();
      if (!any_left) return status_.value_or(kCannotStart);
      if (status_ || getppid() != parent_) is_stopped_ = true;
      if (is_stopped_) stop();
      if (stopped_at_ && Clock::now() - *stopped_at_ > kLongest) return status_.value_or(128 + SIGKILL);
      siginfo_t info;
      const int signal = is_stopped_ ? sigtimedwait(&awaited, &info, &kPoll) : sigwaitinfo(&awaited, &info);
      if (signal != SIGTERM) continue;
      is_hurried_ = is_told_;
      is_told_ = is_stopped_ = true;
    }
  }

 private:
  // Returns whether a child is left.
  bool reap() {
    for (;;) {
      int status = 0;
      const pid_t ended = waitpid(-1, &status, WNOHANG);
      if (ended == 0) return true;
      if (ended < 0) return errno == EINTR;
      std::erase(told_, ended);
      if (ended == command_) status_ = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
    }
  }

  // Sends each child a SIGTERM, and SIGKILL once the grace is over; what outlives the command gets no grace.
  void stop() {
    const auto now = Clock::now();
    if (!stopped_at_) stopped_at_ = now;
    const auto grace = getppid() == parent_ ? kGrace : kGraceWithoutParent;
    const bool is_over = status_.has_value() || is_hurried_ || now - *stopped_at_ >= grace;
    std::vector<pid_t> all = children();
    if (all.empty() && !status_) all.push_back(command_);
    for (const pid_t child : all) {
      if (is_over) {
        kill(child, SIGKILL);
      } else if (std::ranges::find(told_, child) == told_.end()) {
        kill(child, SIGTERM);
        told_.push_back(child);
      }
    }
  }

  pid_t parent_, command_;
  std::optional<int> status_;                                       // of the command
  bool is_stopped_ = false, is_told_ = false, is_hurried_ = false;  // told: by SIGTERM; hurried: by another
  std::optional<Clock::time_point> stopped_at_;
  std::vector<pid_t> told_;
};

}  // namespace

void supervise(pid_t parent, const std::function<void(pid_t)>& become_command) noexcept {
  sigset_t deferred, awaited;
  sigemptyset(&awaited);
  for (const int signal : {SIGCHLD, SIGTERM}) sigaddset(&awaited, signal);
  deferred = awaited;
  for (const int signal : {SIGINT, SIGHUP, SIGQUIT}) sigaddset(&deferred, signal);
  sigprocmask(SIG_BLOCK, &deferred, nullptr);
  signal(SIGCHLD, SIG_DFL);
  prctl(PR_SET_CHILD_SUBREAPER, 1);
  prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (getppid() != parent) _exit(kCannotStart);  // it ended before
  const pid_t supervisor = getpid(), command = fork();
  if (command == 0) {
    sigset_t ours;
    sigemptyset(&ours);
    for (const int signal : {SIGCHLD, SIGQUIT}) sigaddset(&ours, signal);
    sigprocmask(SIG_UNBLOCK, &ours, nullptr);
    become_command(supervisor);
    _exit(kCannotStart);
  }
  if (command < 0) _exit(kCannotStart);
  // Files and locks of the parent end with it.
  close_range(STDERR_FILENO + 1, ~0U, 0);
  _exit(Supervisor(parent, command).run(awaited));
}

}  // namespace common

#include "common/process/Supervisor.h"

#include <signal.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <cstdint>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <sstream>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "common/process/Arguments.h"

namespace common {
namespace {

using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

constexpr auto kGrace = 1500ms;  // ControllerProcess sends SIGKILL after 2 s
constexpr auto kLongest = 5s;    // a process that waits for a broken disk cannot be killed
constexpr timespec kPollOfEnd{0, 10'000'000}, kPoll{0, 100'000'000};
// Counted, not timed: a machine that was suspended, or too busy for this process, has not looked meanwhile.
constexpr int kPollsBetweenLooks = 10, kLooksWithoutWork = 10;
constexpr long kMaxWorkWithoutData_s = 60;
constexpr int kCannotStart = 2;

// A process or thread, by its file `stat`.
struct Task {
  pid_t number = 0, parent = 0;
  char state = '\0';
  std::uint64_t ticks = 0;  // of processor time
};

std::optional<Task> read_task(const std::filesystem::path& folder) {
  Task task;
  const std::string name = folder.filename().string();
  const auto [end, failure] = std::from_chars(name.data(), name.data() + name.size(), task.number);
  if (failure != std::errc() || end != name.data() + name.size()) return std::nullopt;
  std::ifstream file(folder / "stat");
  const std::string text((std::istreambuf_iterator<char>(file)), {});
  std::istringstream fields(text.substr(std::min(text.rfind(')'), text.size() - 1) + 1));
  constexpr int kFromParentToTicks = 9;
  std::uint64_t user = 0, system = 0;
  fields >> task.state >> task.parent;
  std::string skipped;
  for (int i = 0; i < kFromParentToTicks; ++i) fields >> skipped;
  fields >> user >> system;
  task.ticks = user + system;
  return fields ? std::optional(task) : std::nullopt;
}

// The processes or threads of a folder of /proc; empty without /proc.
std::vector<Task> tasks(const std::filesystem::path& folder) {
  std::vector<Task> all;
  std::error_code error;
  auto entry = std::filesystem::directory_iterator(folder, error);
  for (; entry != std::filesystem::directory_iterator(); entry.increment(error))
    if (const auto task = read_task(entry->path())) all.push_back(*task);
  return all;
}

// Children of this process alone: the numbers of others may have passed on to other processes when a signal
// reaches them. What a child leaves when it ends becomes a child of this process.
std::vector<pid_t> children() {
  std::vector<pid_t> all;
  for (const Task& task : tasks("/proc"))
    if (task.parent == getpid()) all.push_back(task.number);
  return all;
}

// Bytes that a process has read and written; nullopt: the kernel does not report them.
std::optional<std::uint64_t> data_of(pid_t process) {
  std::ifstream file("/proc/" + std::to_string(process) + "/io");
  std::string name;
  std::uint64_t read = 0, written = 0;
  file >> name >> read >> name >> written;
  return file ? std::optional(read + written) : std::nullopt;
}

// The work of all processes below this one.
struct Work {
  std::uint64_t ticks = 0;  // of processor time
  std::uint64_t data = 0;   // changes when data are read or written, and when a process starts or ends
};

// nullopt: unknown, or one of them is stopped, or waits for a disk.
std::optional<Work> work_below() {
  const std::vector<Task> all = tasks("/proc");
  std::vector<pid_t> below{getpid()};
  Work work;
  for (std::size_t i = 0; i < below.size(); ++i)
    for (const Task& process : all) {
      if (process.parent != below[i]) continue;
      below.push_back(process.number);
      work.data +=
          static_cast<std::uint64_t>(process.number) + data_of(process.number).value_or(process.ticks);
      for (const Task& thread : tasks("/proc/" + std::to_string(process.number) + "/task")) {
        if (std::string_view("DTt").find(thread.state) != std::string_view::npos) return std::nullopt;
        work.ticks += thread.ticks;
      }
    }
  return below.size() > 1 ? std::optional(work) : std::nullopt;
}

// Input waits, or has ended.
bool has_input(int socket) {
  char byte = 0;
  return socket >= 0 && recv(socket, &byte, 1, MSG_PEEK | MSG_DONTWAIT) >= 0;
}

class Supervisor {
 public:
  Supervisor(const Supervision& task, pid_t command) : task_(task), command_(command) {}

  // Returns the exit status once no process is left.
  int run(const sigset_t& awaited) {
    for (;;) {
      const bool any_left = reap();
      if (!any_left) return status_.value_or(kCannotStart);
      if (status_ || getppid() != task_.parent) is_stopped_ = true;
      if (is_stopped_) stop();
      if (stopped_at_ && Clock::now() - *stopped_at_ > kLongest) return status_.value_or(128 + SIGKILL);
      siginfo_t info;
      // A parent that has given up its rights since cannot send its signal.
      const bool polls = is_stopped_ || task_.input >= 0;
      const int signal = polls ? sigtimedwait(&awaited, &info, is_stopped_ ? &kPollOfEnd : &kPoll)
                               : sigwaitinfo(&awaited, &info);
      if (!is_stopped_ && signal < 0 && ++polls_ % kPollsBetweenLooks == 0) look_for_progress();
      if (signal != SIGTERM) continue;
      second_signal_ = term_received_;
      term_received_ = is_stopped_ = true;
    }
  }
  bool term_received() const { return term_received_; }

 private:
  // Returns whether a child is left.
  bool reap() {
    for (;;) {
      int status = 0;
      const pid_t ended = waitpid(-1, &status, WNOHANG);
      if (ended == 0) return true;
      if (ended < 0) return errno == EINTR;
      std::erase(term_sent_to_, ended);
      if (ended == command_ && !status_)
        status_ = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
    }
  }

  void look_for_progress() {
    const std::optional<Work> work = has_input(task_.input) ? work_below() : std::nullopt;
    if (!work || !at_data_ || work->data != at_data_->data) {
      at_data_ = last_ = work;
      looks_without_work_ = 0;
      return;
    }
    looks_without_work_ = work->ticks == last_->ticks ? looks_without_work_ + 1 : 0;
    last_ = work;
    const auto most = static_cast<std::uint64_t>(kMaxWorkWithoutData_s * sysconf(_SC_CLK_TCK));
    if (looks_without_work_ >= kLooksWithoutWork || work->ticks > at_data_->ticks + most) status_ = kStalled;
  }

  // Sends each child a SIGTERM, and SIGKILL once the grace is over; what outlives the command gets no grace.
  void stop() {
    const auto now = Clock::now();
    if (!stopped_at_) stopped_at_ = now;
    const auto grace = getppid() == task_.parent ? kGrace : task_.grace_without_parent;
    const bool is_over = status_.has_value() || second_signal_ || now - *stopped_at_ >= grace;
    std::vector<pid_t> all = children();
    if (all.empty() && !status_) all.push_back(command_);
    for (const pid_t child : all) {
      if (is_over) {
        kill(child, SIGKILL);
      } else if (std::ranges::find(term_sent_to_, child) == term_sent_to_.end()) {
        kill(child, SIGTERM);
        term_sent_to_.push_back(child);
      }
    }
  }

  const Supervision& task_;
  pid_t command_;
  std::optional<int> status_;                                                // of the command
  bool is_stopped_ = false, term_received_ = false, second_signal_ = false;  // of SIGTERM
  std::optional<Clock::time_point> stopped_at_;
  std::vector<pid_t> term_sent_to_;
  int polls_ = 0, looks_without_work_ = 0;
  std::optional<Work> last_, at_data_;  // at the last look, and when data were last read or written
};

[[noreturn]] void supervise_once(const Supervision& task) {
  sigset_t deferred, awaited;
  sigemptyset(&awaited);
  for (const int signal : {SIGCHLD, SIGTERM}) sigaddset(&awaited, signal);
  deferred = awaited;
  for (const int signal : {SIGINT, SIGHUP, SIGQUIT}) sigaddset(&deferred, signal);
  sigprocmask(SIG_BLOCK, &deferred, nullptr);
  signal(SIGCHLD, SIG_DFL);
  prctl(PR_SET_CHILD_SUBREAPER, 1);
  prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (getppid() != task.parent) _exit(kCannotStart);  // it ended before
  const pid_t supervisor = getpid(), command = fork();
  if (command == 0) {
    sigset_t ours;
    sigemptyset(&ours);
    for (const int signal : {SIGCHLD, SIGQUIT}) sigaddset(&ours, signal);
    sigprocmask(SIG_UNBLOCK, &ours, nullptr);
    task.become_command(supervisor);
    _exit(kCannotStart);
  }
  if (command < 0) _exit(kCannotStart);
  // Files and locks of the parent end with it.
  if (task.input > STDERR_FILENO + 1)
    close_range(STDERR_FILENO + 1, static_cast<unsigned>(task.input) - 1, 0);
  close_range(static_cast<unsigned>(std::max(task.input, STDERR_FILENO)) + 1, ~0U, 0);
  Supervisor supervision(task, command);
  const int status = supervision.run(awaited);
  // The parent's signal comes when its main thread has ended, maybe before the others have.
  if (task.at_end_without_parent && (supervision.term_received() || getppid() != task.parent))
    task.at_end_without_parent();
  _exit(status);
}

}  // namespace

void execute(const std::vector<std::string>& command, pid_t parent, int signal) noexcept {
  // The handler of the process that was forked, which stands until the program does, would swallow it.
  ::signal(SIGTERM, SIG_DFL);
  prctl(PR_SET_PDEATHSIG, signal);
  if (getppid() != parent) _exit(kCannotStart);  // it ended before
  for (const int ignored : {SIGPIPE, SIGXFSZ}) ::signal(ignored, SIG_DFL);
  sigset_t deferred;
  sigemptyset(&deferred);
  for (const int one : {SIGINT, SIGTERM, SIGHUP, SIGXCPU}) sigaddset(&deferred, one);
  sigprocmask(SIG_UNBLOCK, &deferred, nullptr);
  const std::vector<char*> arguments = argument_pointers(command);
  execvp(arguments[0], arguments.data());
}

// Two of them: if one is killed, the other ends the rest.
void supervise(const Supervision& task) noexcept {
  Supervision first = task;
  first.input = -1;
  first.become_command = [&task](pid_t supervisor) {
    Supervision second = task;
    second.parent = supervisor;
    supervise_once(second);
  };
  supervise_once(first);
}

}  // namespace common

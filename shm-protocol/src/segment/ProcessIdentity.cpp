#include "ProcessIdentity.h"

#include <fcntl.h>
#include <signal.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <optional>

#include "shm_protocol/Error.h"
#include "shm_protocol/layout.h"

namespace shm_protocol {
namespace {

struct ProcStat {
  char state = '?';
  long threads = 0;
  std::uint64_t start_ticks = 0;
};

// The n-th space-separated field of `text`, counting from 0; null if there are fewer.
const char* field(const char* text, int n) {
  for (; n > 0 && text; --n) {
    text = std::strchr(text, ' ');
    if (text) ++text;
  }
  return text;
}

std::optional<ProcStat> read_stat(std::uint32_t pid) {
  // The same as /proc/PID/stat, which qemu-user invents for its own process.
  char path[48];
  std::snprintf(path, sizeof path, "/proc/%u/task/%u/stat", pid, pid);
  const int file = ::open(path, O_RDONLY | O_CLOEXEC);
  if (file < 0) return std::nullopt;
  char text[1024];
  const ssize_t length = ::read(file, text, sizeof text - 1);
  ::close(file);
  if (length <= 0) return std::nullopt;
  text[length] = '\0';
  // Field 2, the program name in parentheses, may itself contain spaces and parentheses: start after it.
  const char* after_name = std::strrchr(text, ')');
  if (!after_name || after_name[1] != ' ') return std::nullopt;
  const char* state = after_name + 2;          // field 3
  const char* threads = field(state, 20 - 3);  // field 20
  const char* start = field(state, 22 - 3);    // field 22
  if (!threads || !start) return std::nullopt;
  return ProcStat{*state, std::strtol(threads, nullptr, 10), std::strtoull(start, nullptr, 10)};
}

constexpr std::uint64_t kPidMask = (std::uint64_t{1} << SSP_PID_BITS) - 1;

}  // namespace

std::uint32_t pid_of(ProcessIdentity word) noexcept { return static_cast<std::uint32_t>(word & kPidMask); }

ProcessIdentity own_process_identity() {
  const auto pid = static_cast<std::uint32_t>(::getpid());
  const auto stat = read_stat(pid);
  if (!stat)
    throw Error(ErrorCode::kSystem, "cannot read /proc/" + std::to_string(pid) + "/stat: is /proc mounted?");
  return (stat->start_ticks << SSP_PID_BITS) | pid;
}

bool is_alive(ProcessIdentity word) noexcept {
  const std::uint32_t pid = pid_of(word);
  if (pid == 0) return false;
  if (const auto stat = read_stat(pid)) {
    if (stat->start_ticks != word >> SSP_PID_BITS) return false;
    // A thread-group leader that exited before its other threads is also Z, but with more than one thread.
    const bool ended = stat->state == 'Z' || stat->state == 'X' || stat->state == 'x';
    return !ended || stat->threads > 1;
  }
  return ::kill(static_cast<pid_t>(pid), 0) == 0 || errno == EPERM;
}

}  // namespace shm_protocol

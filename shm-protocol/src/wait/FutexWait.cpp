#include "FutexWait.h"

#include <linux/futex.h>
#include <sched.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <climits>
#include <ctime>

namespace shm_protocol {
namespace {

// Without FUTEX_PRIVATE_FLAG: the futex key must be the shared page, not this process's address; otherwise
// the peer would never be woken.
long futex(const std::uint32_t& word, int operation, std::uint32_t value, const timespec* timeout) noexcept {
  return ::syscall(SYS_futex, &word, operation, value, timeout, nullptr, 0);
}

}  // namespace

bool LivenessTimer::due() noexcept {
  const auto now = Clock::now();
  if (now - last_check_ < kSleepSlice) return false;
  last_check_ = now;
  return true;
}

std::uint32_t current_cpu() noexcept {
  const int cpu = ::sched_getcpu();
  return cpu < 0 ? SSP_CPU_UNKNOWN : static_cast<std::uint32_t>(cpu);
}

void futex_wait(const std::uint32_t& word, std::uint32_t seen, std::chrono::nanoseconds slice) noexcept {
  const auto ns = slice.count();
  const timespec timeout{static_cast<time_t>(ns / 1'000'000'000), static_cast<long>(ns % 1'000'000'000)};
  futex(word, FUTEX_WAIT, seen, &timeout);
}

void futex_wake(const std::uint32_t& word) noexcept { futex(word, FUTEX_WAKE, INT_MAX, nullptr); }

const char* text(Status status) noexcept {
  switch (status) {
    case Status::kOk:
      return "ok";
    case Status::kRepeated:
      return "no newer frame";
    case Status::kTorn:
      return "frame torn or malformed";
    case Status::kTimeout:
      return "timed out";
    case Status::kInterrupted:
      return "interrupted";
    case Status::kOutOfTurn:
      return "out of turn";
    case Status::kNoController:
      return "no controller is attached";
    case Status::kControllerDead:
      return "the controller died";
    case Status::kControllerClosed:
      return "the controller detached";
    case Status::kSurfaceDead:
      return "the surface died";
    case Status::kSurfaceClosed:
      return "the surface is closing";
  }
  return "unknown";
}

}  // namespace shm_protocol

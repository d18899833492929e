#include "FutexWait.h"

#include <linux/futex.h>
#include <sched.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <climits>
#include <ctime>
#include <iterator>

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
  constexpr const char* kTexts[] = {"ok",
                                    "no newer frame",
                                    "frame torn or malformed",
                                    "timed out",
                                    "interrupted",
                                    "out of turn",
                                    "no controller is attached",
                                    "the controller died",
                                    "the controller detached",
                                    "the surface died",
                                    "the surface is closing"};
  const auto i = static_cast<std::size_t>(status);
  return i < std::size(kTexts) ? kTexts[i] : "unknown";
}

}  // namespace shm_protocol

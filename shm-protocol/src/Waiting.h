// Waiting for the peer's next word: a short bounded spin, then a process-shared futex in slices, with a
// deadline.
//
// No wake-up is lost. The sleeper stores its waiting flag and then loads the word; the publisher stores the
// word and then loads the flag; all four are sequentially consistent, so at least one of them sees the
// other's store: either the sleeper sees the new word and does not sleep, or the publisher sees the flag and
// calls FUTEX_WAKE, and FUTEX_WAIT itself refuses to sleep on a word that changed. With release and acquire
// alone both loads could pass both stores. Should a publisher be killed between its store and its wake, the
// end of the slice finds the word.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>

#include "Words.h"
#include "shm_protocol/Wait.h"
#include "shm_protocol/layout.h"

namespace shm_protocol {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::microseconds kSpin{50};
constexpr std::chrono::milliseconds kSlice{50};  // liveness and the stop flag are looked at this often

// Where a sleeper sleeps and how its peer knows.
struct Doorbell {
  const std::uint32_t& word;
  std::uint32_t& waiting;
  const std::uint32_t& peer_cpu;
};

// Says when the peer's process should be looked up again: that costs a system call or three.
class LivenessClock {
 public:
  bool due() noexcept;

 private:
  Clock::time_point last_{};
};

// The CPU the caller runs on.
std::uint32_t current_cpu() noexcept;

// Returns when the word differs from `seen`, when woken, after `slice`, or on a signal.
void futex_wait(const std::uint32_t& word, std::uint32_t seen, std::chrono::nanoseconds slice) noexcept;
void futex_wake(const std::uint32_t& word) noexcept;

inline void relax_cpu() noexcept {
#if defined(__x86_64__) || defined(__i386__)
  __builtin_ia32_pause();
#elif defined(__aarch64__)
  asm volatile("yield");
#endif
}

// Publishes: everything written before is visible to whoever sees the word; wakes a sleeper.
inline void ring(std::uint32_t& word, std::uint32_t value, const std::uint32_t& peer_waiting) noexcept {
  store_sequential(word, value);
  if (load_sequential(peer_waiting)) futex_wake(word);
}

// Spinning pays only while the peer runs on another core; on the same core it keeps the peer from running.
template <class Ready>
bool spin_until(const Doorbell& bell, Clock::time_point end, Ready&& ready) noexcept {
  const std::uint32_t peer = load_relaxed(bell.peer_cpu);
  if (peer == SSP_CPU_UNKNOWN || peer == current_cpu()) return false;
  do {
    for (int i = 0; i < 32; ++i) {
      if (ready()) return true;
      relax_cpu();
    }
  } while (Clock::now() < end);
  return false;
}

// Waits until ready() (kOk), or until the deadline, the stop flag or peer(look_up) ends it; peer() says kOk
// while the wait makes sense, and looks the process up when told to.
template <class Ready, class Peer>
Status wait_until(const Doorbell& bell, const WaitOptions& options, LivenessClock& liveness, Ready&& ready,
                  Peer&& peer) noexcept {
  if (ready()) return Status::kOk;
  const auto start = Clock::now();
  const bool for_ever = options.timeout >= WaitOptions::kForever - start.time_since_epoch();
  const auto deadline = for_ever ? Clock::time_point::max() : start + options.timeout;
  if (spin_until(bell, std::min(deadline, start + kSpin), ready)) return Status::kOk;
  for (;;) {
    if (options.stop && options.stop->load(std::memory_order_relaxed)) return Status::kInterrupted;
    if (const Status s = peer(false); s != Status::kOk) return ready() ? Status::kOk : s;
    const auto now = Clock::now();
    const auto left = std::min<std::chrono::nanoseconds>(kSlice, deadline - now);
    if (left > left.zero()) {
      store_sequential(bell.waiting, 1);
      const std::uint32_t seen = load_sequential(bell.word);
      if (!ready()) futex_wait(bell.word, seen, left);
      store_relaxed(bell.waiting, 0);
    }
    if (ready()) return Status::kOk;
    if (liveness.due()) {
      if (const Status s = peer(true); s != Status::kOk) return ready() ? Status::kOk : s;
    }
    if (Clock::now() >= deadline) return Status::kTimeout;
  }
}

}  // namespace shm_protocol

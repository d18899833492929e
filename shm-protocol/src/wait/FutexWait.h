// Waits for the peer's next word: a bounded spin, then a process-shared futex in slices, with a deadline.
//
// No wake-up is lost. The sleeper stores its waiting flag and then loads the word; the publisher stores the
// word and then loads the flag. All four are sequentially consistent, so at least one side sees the other's
// store: either the sleeper sees the new word and does not sleep, or the publisher sees the flag and calls
// FUTEX_WAKE. FUTEX_WAIT itself refuses to sleep on a changed word. With release and acquire alone, both
// loads could pass both stores. If a publisher is killed between its store and its wake, the sleeper finds
// the word at the end of the slice.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <utility>

#include "Atomics.h"
#include "shm_protocol/Wait.h"
#include "shm_protocol/layout.h"

namespace shm_protocol {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::microseconds kMinSpin{50};
constexpr std::chrono::microseconds kMaxSpin{2000};
constexpr std::chrono::milliseconds kSleepSlice{50};  // interval of the liveness and stop-flag checks
constexpr std::chrono::microseconds kPreemptionThreshold{300};  // a longer gap while spinning: preempted

// The futex word, the sleeper's waiting flag and the peer's CPU.
struct Doorbell {
  const std::uint32_t& word;
  std::uint32_t& waiting;
  const std::uint32_t& peer_cpu;
};

// Rate-limits liveness checks, which cost up to three system calls.
class LivenessTimer {
 public:
  bool due() noexcept;

 private:
  Clock::time_point last_check_{};
};

// Derives the spin time from the mean wait. A sleep adds about 25 µs, so usually short waits are spent
// spinning, slightly longer than the mean, as long as no other thread competes for the core.
class AdaptiveSpin {
 public:
  std::chrono::nanoseconds budget() const noexcept {
    if (backoff_waits_ > 0 || mean_wait_ > kMaxSpin) return kMinSpin;
    return mean_wait_ + std::max<std::chrono::nanoseconds>(kMinSpin, mean_wait_ / 5);
  }
  // `preempted`: another thread ran on the core during the spin. Repeated preemption increases the back-off
  // exponentially.
  void record_wait(std::chrono::nanoseconds wait, bool preempted) noexcept {
    mean_wait_ += (std::min<std::chrono::nanoseconds>(wait, 10 * kMaxSpin) - mean_wait_) / 8;
    if (backoff_waits_ > 0 && --backoff_waits_ > 0) return;
    backoff_ = preempted ? std::min(kMaxBackoff, 2 * backoff_ + 4) : backoff_ / 2;
    if (preempted) backoff_waits_ = backoff_;
  }

 private:
  static constexpr int kMaxBackoff = 64;

  std::chrono::nanoseconds mean_wait_{0};
  int backoff_waits_ = 0;  // remaining waits with the minimum spin
  int backoff_ = 0;        // length of the last back-off, in waits
};

// The state that one side keeps between waits.
struct WaitState {
  LivenessTimer liveness;
  AdaptiveSpin adaptive_spin;
  std::uint64_t chunks = 0;  // chunks of large frames taken while waiting; counted by ready()
};

// The CPU that the caller runs on.
std::uint32_t current_cpu() noexcept;

// Returns if the word differs from `seen`, when woken, after `slice`, or on a signal.
void futex_wait(const std::uint32_t& word, std::uint32_t seen, std::chrono::nanoseconds slice) noexcept;
void futex_wake(const std::uint32_t& word) noexcept;

inline void relax_cpu() noexcept {
#if defined(__x86_64__) || defined(__i386__)
  __builtin_ia32_pause();
#elif defined(__aarch64__)
  asm volatile("yield");
#endif
}

// Publishes: a reader that sees the word sees everything written before. Wakes a sleeping peer.
inline void store_and_wake(std::uint32_t& word, std::uint32_t value,
                           const std::uint32_t& peer_waiting) noexcept {
  store_seq_cst(word, value);
  if (load_seq_cst(peer_waiting)) futex_wake(word);
}

// Returns whether the peer runs on another CPU; false if unknown.
inline bool is_on_other_core(const std::uint32_t& peer_cpu) noexcept {
  const std::uint32_t peer = load_relaxed(peer_cpu);
  return peer != SSP_CPU_UNKNOWN && peer != current_cpu();
}

// Measures a spin and detects preemption from gaps between the clock readings.
struct SpinTimer {
  Clock::time_point now;   // last clock reading
  bool preempted = false;  // a gap between two readings exceeded kPreemptionThreshold

  void sample(bool made_progress) noexcept {
    const auto before = std::exchange(now, Clock::now());
    preempted |= !made_progress && now - before > kPreemptionThreshold;
  }
};

// Spinning pays only while the peer runs on another core; on the same core it keeps the peer from running.
template <class Ready>
bool spin_until(const Doorbell& bell, Clock::time_point end, const WaitState& wait_state, SpinTimer& timer,
                Ready&& ready) noexcept {
  if (!is_on_other_core(bell.peer_cpu)) return false;
  bool done = false;
  for (bool first = true; !done && (first || timer.now < end); first = false) {
    const std::uint64_t chunks_before = wait_state.chunks;
    // Spin less aggressively after the first round: on SMT siblings the spinner slows its peer down.
    for (int i = 0; i < (first ? 64 : 16) && !done; ++i) {
      done = ready();
      for (int pause = 0; pause < (first ? 1 : 4) && !done; ++pause) relax_cpu();
    }
    if (!done || !first)  // a short wait does not pay for a clock reading
      timer.sample(wait_state.chunks != chunks_before);
  }
  return done;
}

// Spins for `length`, then continues while chunks keep arriving. Bounded regardless of the peer.
template <class Ready>
bool spin_while_chunks_arrive(const Doorbell& bell, std::chrono::nanoseconds length,
                              Clock::time_point deadline, const WaitState& wait_state, SpinTimer& timer,
                              Ready&& ready) noexcept {
  for (int rounds = 0; rounds < 1000; ++rounds) {
    const std::uint64_t chunks_before = wait_state.chunks;
    if (spin_until(bell, std::min(deadline, timer.now + length), wait_state, timer, ready)) return true;
    if (wait_state.chunks == chunks_before || timer.now >= deadline) return false;
    length = kMinSpin;
  }
  return false;
}

// Waits until ready() returns true (kOk), or until the deadline, the stop flag or check_peer ends the wait.
// check_peer(check_liveness) returns kOk as long as waiting makes sense and looks up the peer's process if
// asked to. ready() is not called again after it returned true, because each call may deliver a chunk.
template <class Ready, class Peer>
Status wait_until(const Doorbell& bell, const WaitOptions& options, WaitState& wait_state, Ready&& ready,
                  Peer&& check_peer) noexcept {
  if (ready()) return Status::kOk;
  const auto start = Clock::now();
  const bool forever = options.timeout >= WaitOptions::kForever - start.time_since_epoch();
  const auto deadline = forever ? Clock::time_point::max() : start + options.timeout;
  SpinTimer timer{start};
  if (spin_while_chunks_arrive(bell, wait_state.adaptive_spin.budget(), deadline, wait_state, timer, ready)) {
    wait_state.adaptive_spin.record_wait(timer.now - start, timer.preempted);
    return Status::kOk;
  }
  for (;;) {
    if (options.stop && options.stop->load(std::memory_order_relaxed)) return Status::kInterrupted;
    if (const Status s = check_peer(false); s != Status::kOk) return ready() ? Status::kOk : s;
    const auto now = Clock::now();
    const auto slice = std::min<std::chrono::nanoseconds>(kSleepSlice, deadline - now);
    const std::uint64_t chunks_before = wait_state.chunks;
    bool done = false;
    if (slice > slice.zero()) {
      store_seq_cst(bell.waiting, 1);
      const std::uint32_t seen = load_seq_cst(bell.word);
      done = ready();
      if (!done) futex_wait(bell.word, seen, slice);
      store_relaxed(bell.waiting, 0);
    }
    if (!done) done = ready();
    if (!done && wait_state.chunks != chunks_before) {
      timer.now = Clock::now();
      done = spin_while_chunks_arrive(bell, kMinSpin, deadline, wait_state, timer, ready);
    }
    if (done) {
      wait_state.adaptive_spin.record_wait(Clock::now() - start, timer.preempted);
      return Status::kOk;
    }
    if (wait_state.liveness.due()) {
      if (const Status s = check_peer(true); s != Status::kOk) return ready() ? Status::kOk : s;
    }
    if (Clock::now() >= deadline) return Status::kTimeout;
  }
}

}  // namespace shm_protocol

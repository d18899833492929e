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
#include <utility>

#include "Words.h"
#include "shm_protocol/Wait.h"
#include "shm_protocol/layout.h"

namespace shm_protocol {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::microseconds kSpin{50};
constexpr std::chrono::microseconds kLongestSpin{2000};
constexpr std::chrono::milliseconds kSlice{50};       // liveness and the stop flag are looked at this often
constexpr std::chrono::microseconds kTakenAway{300};  // a spinner that misses so much was off its core

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

// How long the peer usually takes: a sleep costs some 25 µs on top of that, so a wait that usually ends soon
// is spent spinning, and a little longer than usual, while nobody else wants the core.
class Pace {
 public:
  std::chrono::nanoseconds spin() const noexcept {
    if (crowded_ > 0 || usual_ > kLongestSpin) return kSpin;
    return usual_ + std::max<std::chrono::nanoseconds>(kSpin, usual_ / 5);
  }
  // `preempted`: while it spun, somebody else had the core. Once may be chance; again and again, that one is
  // let have it for longer and longer.
  void took(std::chrono::nanoseconds wait, bool preempted) noexcept {
    usual_ += (std::min<std::chrono::nanoseconds>(wait, 10 * kLongestSpin) - usual_) / 8;
    if (crowded_ > 0 && --crowded_ > 0) return;
    penalty_ = preempted ? std::min(kLongestPenalty, 2 * penalty_ + 4) : penalty_ / 2;
    if (preempted) crowded_ = penalty_;
  }

 private:
  static constexpr int kLongestPenalty = 64;

  std::chrono::nanoseconds usual_{0};
  int crowded_ = 0;  // so many waits without a stretched spin
  int penalty_ = 0;  // the crowd's, when it was seen last
};

// What a side remembers from one wait to the next.
struct Patience {
  LivenessClock liveness;
  Pace pace;
  std::uint64_t pieces = 0;  // of large frames, taken while waiting: counted by ready()
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

// Whether the peer runs on another core, as far as is known.
inline bool is_elsewhere(const std::uint32_t& peer_cpu) noexcept {
  const std::uint32_t peer = load_relaxed(peer_cpu);
  return peer != SSP_CPU_UNKNOWN && peer != current_cpu();
}

// What a spinner saw of the time. The clock tells it, at no further cost, whether it lost its core for a
// while.
struct Spin {
  Clock::time_point now;   // what the clock said last
  bool preempted = false;  // between two looks at the clock more time passed than they take

  void look(bool worked) noexcept {
    const auto before = std::exchange(now, Clock::now());
    preempted |= !worked && now - before > kTakenAway;
  }
};

// Spinning pays only while the peer runs on another core; on the same core it keeps the peer from running.
template <class Ready>
bool spin_until(const Doorbell& bell, Clock::time_point end, const Patience& patience, Spin& spin,
                Ready&& ready) noexcept {
  if (!is_elsewhere(bell.peer_cpu)) return false;
  bool there = false;
  for (bool first = true; !there && (first || spin.now < end); first = false) {
    const std::uint64_t pieces = patience.pieces;
    // Less eagerly after a while: where two CPUs are threads of one core, the spinner slows its peer down.
    for (int i = 0; i < (first ? 64 : 16) && !there; ++i) {
      there = ready();
      for (int pause = 0; pause < (first ? 1 : 4) && !there; ++pause) relax_cpu();
    }
    if (!there || !first)
      spin.look(patience.pieces != pieces);  // a short wait is not made longer by the clock
  }
  return there;
}

// Spins for `length`, and on while pieces keep coming in: bounded, whatever the peer does.
template <class Ready>
bool spin_while_pieces_come(const Doorbell& bell, std::chrono::nanoseconds length, Clock::time_point deadline,
                            const Patience& patience, Spin& spin, Ready&& ready) noexcept {
  for (int rounds = 0; rounds < 1000; ++rounds) {
    const std::uint64_t before = patience.pieces;
    if (spin_until(bell, std::min(deadline, spin.now + length), patience, spin, ready)) return true;
    if (patience.pieces == before || spin.now >= deadline) return false;
    length = kSpin;
  }
  return false;
}

// Waits until ready() (kOk), or until the deadline, the stop flag or peer(look_up) ends it; peer() says kOk
// while the wait makes sense, and looks the process up when told to. Once ready() has said yes it is not
// asked again: it may hand out a piece each time.
template <class Ready, class Peer>
Status wait_until(const Doorbell& bell, const WaitOptions& options, Patience& patience, Ready&& ready,
                  Peer&& peer) noexcept {
  if (ready()) return Status::kOk;
  const auto start = Clock::now();
  const bool for_ever = options.timeout >= WaitOptions::kForever - start.time_since_epoch();
  const auto deadline = for_ever ? Clock::time_point::max() : start + options.timeout;
  Spin spin{start};
  if (spin_while_pieces_come(bell, patience.pace.spin(), deadline, patience, spin, ready)) {
    patience.pace.took(spin.now - start, spin.preempted);
    return Status::kOk;
  }
  for (;;) {
    if (options.stop && options.stop->load(std::memory_order_relaxed)) return Status::kInterrupted;
    if (const Status s = peer(false); s != Status::kOk) return ready() ? Status::kOk : s;
    const auto now = Clock::now();
    const auto left = std::min<std::chrono::nanoseconds>(kSlice, deadline - now);
    const std::uint64_t pieces = patience.pieces;
    bool there = false;
    if (left > left.zero()) {
      store_sequential(bell.waiting, 1);
      const std::uint32_t seen = load_sequential(bell.word);
      there = ready();
      if (!there) futex_wait(bell.word, seen, left);
      store_relaxed(bell.waiting, 0);
    }
    if (!there) there = ready();
    if (!there && patience.pieces != pieces) {
      spin.now = Clock::now();
      there = spin_while_pieces_come(bell, kSpin, deadline, patience, spin, ready);
    }
    if (there) {
      patience.pace.took(Clock::now() - start, spin.preempted);
      return Status::kOk;
    }
    if (patience.liveness.due()) {
      if (const Status s = peer(true); s != Status::kOk) return ready() ? Status::kOk : s;
    }
    if (Clock::now() >= deadline) return Status::kTimeout;
  }
}

}  // namespace shm_protocol

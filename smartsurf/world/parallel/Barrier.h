// A split-phase barrier for a fixed number of threads.
#pragma once

#include <atomic>
#include <thread>
#include <vector>

#include "common/threads/Core.h"
#include "common/threads/ThreadPool.h"

namespace smartsurf::world {

// arrive() and wait() are separate, so that a member can work in between.
//
// Each member counts its arrivals on a cache line that it alone writes, and waiters read the counts of the
// others. This costs one transfer between cores, where a shared counter costs several.
//
// A waiter spins first (common::spin_until), because phases last microseconds and a futex sleep costs tens of
// them, and then sleeps, so that another process on the core of a late member can finish.
class Barrier {
 public:
  explicit Barrier(int member_count)
      : slots_(member_count),
        spins_(static_cast<unsigned>(member_count) <= std::thread::hardware_concurrency()) {}

  // Everything the member did before is visible to members whose wait() returns after it. Each arrive() must
  // be followed by the member's own wait().
  void arrive(int member) {
    ArrivalSlot& own = slots_[member];
    own.core.store(common::current_core(), std::memory_order_relaxed);
    own.arrivals.store(own.arrivals.load(std::memory_order_relaxed) + 1, std::memory_order_release);
    notify_sleepers(own);
  }
  // Blocks until every other member has arrived as often as this one.
  void wait(int member) {
    ArrivalSlot& own = slots_[member];
    // Notifies members that fell asleep while this one arrived. Detecting them in arrive() would take a fence
    // there, which delays every arrival by a transfer between cores.
    full_fence();
    notify_sleepers(own);
    const unsigned target = own.arrivals.load(std::memory_order_relaxed);
    for (const ArrivalSlot& other : slots_)
      if (!other.has_reached(target)) wait_for(other, target);
  }

 private:
  // Aligned to two cache lines, which some cores prefetch as a pair.
  struct alignas(128) ArrivalSlot {
    std::atomic<unsigned> arrivals{0};
    std::atomic<int> core{-1};  // of the member, when it arrived last
    bool has_reached(unsigned target) const {
      return static_cast<int>(arrivals.load(std::memory_order_acquire) - target) >= 0;
    }
  };

  static void full_fence() {
#if defined(__SANITIZE_THREAD__) && !defined(__clang__)
// ThreadSanitizer does not model fences; this one orders only notifications, not data.
#pragma GCC diagnostic ignored "-Wtsan"
#endif
    std::atomic_thread_fence(std::memory_order_seq_cst);
  }
  void notify_sleepers(ArrivalSlot& own) {
    if (sleeping_.load(std::memory_order_relaxed) > 0) own.arrivals.notify_all();
  }

  void wait_for(const ArrivalSlot& other, unsigned target) {
    const std::int64_t spins = common::spins_of_this_thread;
    if (!spins_ || !common::spin_until([&] { return other.has_reached(target); })) sleep_until(other, target);
    // A long wait for a member on the same core: both need it, so this one moves.
    const bool was_long = common::spins_of_this_thread - spins >= common::kSpinsPerLook;
    if (was_long && other.core.load(std::memory_order_relaxed) == common::current_core())
      common::leave_core();
  }

  void sleep_until(const ArrivalSlot& other, unsigned target) {
    sleeping_.fetch_add(1, std::memory_order_relaxed);
    full_fence();
    while (!other.has_reached(target)) {
      const unsigned current = other.arrivals.load(std::memory_order_acquire);
      if (static_cast<int>(current - target) < 0) other.arrivals.wait(current, std::memory_order_acquire);
    }
    sleeping_.fetch_sub(1, std::memory_order_relaxed);
  }

  std::vector<ArrivalSlot> slots_;
  bool spins_;  // the members do not outnumber the cores
  alignas(128) std::atomic<int> sleeping_{0};
};

}  // namespace smartsurf::world

// The threads of a pool working through one step together: each takes its share of every phase and waits at a
// barrier for the others, also while the first does alone what cannot be shared: to wake a thread takes
// longer. Shares depend on the number of threads, results may not.
#pragma once

#include <hwy/cache_control.h>

#include <algorithm>
#include <atomic>
#include <vector>

#include "common/threads/ThreadPool.h"

namespace smartsurf::world {

// Each member counts its arrivals, on a line of memory that it alone writes, and who waits reads the others'
// counts: one trip between the cores, where a count in common takes several.
//
// Who waits looks for a while, for phases last microseconds and a sleep costs tens of them; then it sleeps,
// so that another program which has the core of a late member gets done with it meanwhile. Looks that were in
// vain make the next ones shorter, others longer: where programs compete for the cores, looking only keeps
// them all from working.
class Barrier {
 public:
  explicit Barrier(int member_count) : slots_(static_cast<std::size_t>(member_count)) {}

  // What the member did so far is seen by all whose wait() comes after this. It must wait() later itself.
  void arrive(int member) {
    ArrivalSlot& own = slots_[static_cast<std::size_t>(member)];
    own.arrivals.store(own.arrivals.load(std::memory_order_relaxed) + 1, std::memory_order_release);
    notify_sleepers(own);
  }
  // Until each of the others has arrived as often as this one.
  void wait(int member) {
    ArrivalSlot& own = slots_[static_cast<std::size_t>(member)];
    // Who fell asleep as it arrived is called now: to make sure of it there would cost every arrival a trip
    // between the cores.
    full_fence();
    notify_sleepers(own);
    const unsigned target = own.arrivals.load(std::memory_order_relaxed);
    for (const ArrivalSlot& other : slots_)
      if (!other.has_reached(target)) wait_for(other, target, own.spin_budget);
  }

 private:
  static constexpr int kMinSpins = 100, kMaxSpins = 2000, kSpinIncrement = 64;  // a look: some 30 ns

  // Two lines each: cores fetch lines by twos.
  struct alignas(128) ArrivalSlot {
    std::atomic<unsigned> arrivals{0};
    alignas(128) int spin_budget = kMaxSpins;
    bool has_reached(unsigned target) const {
      return static_cast<int>(arrivals.load(std::memory_order_acquire) - target) >= 0;
    }
  };

  static void full_fence() {
#ifdef __SANITIZE_THREAD__
#pragma GCC diagnostic ignored "-Wtsan"  // which does not see it; it orders nothing but calls
#endif
    std::atomic_thread_fence(std::memory_order_seq_cst);
  }
  void notify_sleepers(ArrivalSlot& own) {
    if (sleeping_.load(std::memory_order_relaxed) > 0) own.arrivals.notify_all();
  }

  void wait_for(const ArrivalSlot& other, unsigned target, int& spin_budget) {
    for (int spin = 0; spin < spin_budget; ++spin) {
      if (other.has_reached(target)) {
        if (spin_budget < kMaxSpins) spin_budget += kSpinIncrement;
        return;
      }
      hwy::Pause();
    }
    spin_budget = std::max(kMinSpins, spin_budget / 2);
    sleeping_.fetch_add(1, std::memory_order_relaxed);
    full_fence();
    while (!other.has_reached(target)) {
      const unsigned current = other.arrivals.load(std::memory_order_acquire);
      if (static_cast<int>(current - target) < 0) other.arrivals.wait(current, std::memory_order_acquire);
    }
    sleeping_.fetch_sub(1, std::memory_order_relaxed);
  }

  std::vector<ArrivalSlot> slots_;
  alignas(128) std::atomic<int> sleeping_{0};
};

struct IndexRange {
  int begin, end;
};

struct Member {
  int index, member_count;
  Barrier& barrier;

  // Whether it is the caller of Team::run.
  bool is_caller() const { return index + 1 == member_count; }
  void arrive() const { barrier.arrive(index); }
  void wait() const { barrier.wait(index); }
  void arrive_and_wait() const { arrive(), wait(); }
  // The leader does it, when all have come so far; the others wait until it is done.
  template <class Work>
  void single(Work work) const {
    arrive_and_wait();
    if (is_caller()) work();
    arrive_and_wait();
  }
  // Its share of n items.
  IndexRange share(int n) const {
    return {static_cast<int>(static_cast<long>(n) * index / member_count),
            static_cast<int>(static_cast<long>(n) * (index + 1) / member_count)};
  }
};

class Team {
 public:
  // Without a pool, or for work too small to share, the caller is the only member.
  explicit Team(common::ThreadPool* pool) : pool_(pool), team_barrier_(pool ? pool->thread_count() : 1) {}

  // work(member) on every thread at once; `parallel`: whether the work is worth it. The caller, thread 0, is the
  // last member: members own slabs from the south, the pool's row bands run from the north, so that each
  // thread finds the cells that it moved itself in its cache.
  template <class Work>
  void run(bool parallel, Work work) {
    const int member_count = parallel && pool_ ? pool_->thread_count() : 1;
    if (member_count == 1) {
      work(Member{0, 1, serial_barrier_});
      return;
    }
    pool_->fork_join([&](int thread) {
      work(Member{member_count - 1 - thread, member_count, team_barrier_});
    });
  }

 private:
  common::ThreadPool* pool_;
  Barrier serial_barrier_{1}, team_barrier_;
};

}  // namespace smartsurf::world

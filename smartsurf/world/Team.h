// The threads of a pool working through one step together: each takes its share of every phase and waits at a
// barrier for the others, also while the first does alone what cannot be shared: to wake a thread takes
// longer. Shares depend on the number of threads, results may not.
#pragma once

#include <hwy/cache_control.h>

#include <atomic>
#include <functional>
#include <thread>

#include "smartsurf/surface/WorkerPool.h"

namespace smartsurf::world {

// Spins: phases last microseconds, a sleep costs tens of them.
class Barrier {
 public:
  explicit Barrier(int members) : members_(members) {}
  void wait() {
    if (members_ == 1) return;
    const unsigned round = round_.load(std::memory_order_acquire);
    if (waiting_.fetch_add(1, std::memory_order_acq_rel) + 1 == members_) {
      waiting_.store(0, std::memory_order_relaxed);
      round_.store(round + 1, std::memory_order_release);
      return;
    }
    for (int spins = 0; round_.load(std::memory_order_acquire) == round; ++spins) {
      // Two threads may share one core: who waits must not keep the other from working.
      hwy::Pause();
      if (spins > kSpins) std::this_thread::yield();
    }
  }

 private:
  static constexpr int kSpins = 2000;
  const int members_;
  alignas(64) std::atomic<int> waiting_{0};
  alignas(64) std::atomic<unsigned> round_{0};
};

struct Range {
  int begin, end;
};

struct Member {
  int index, members;
  Barrier& barrier;

  bool first() const { return index == 0; }
  void wait() const { barrier.wait(); }
  // The first does it, when all have come so far; the others wait until it is done.
  template <class Work>
  void alone(Work work) const {
    wait();
    if (first()) work();
    wait();
  }
  // Its share of n items.
  Range share(int n) const {
    return {static_cast<int>(static_cast<long>(n) * index / members),
            static_cast<int>(static_cast<long>(n) * (index + 1) / members)};
  }
};

class Team {
 public:
  // Without a pool, or for work too small to share, the caller is the only member.
  explicit Team(surface::WorkerPool* pool) : pool_(pool) {}

  template <class Work>
  void run(bool shared, Work work) {
    const int members = shared && pool_ ? pool_->threads() : 1;
    Barrier barrier(members);
    if (members == 1) {
      work(Member{0, 1, barrier});
      return;
    }
    // Two rows a thread: the pool keeps anything smaller on the caller.
    const std::function<void(int, int)> band = [&](int begin, int) {
      work(Member{begin / 2, members, barrier});
    };
    pool_->for_rows(2 * members, band);
  }

 private:
  surface::WorkerPool* pool_;
};

}  // namespace smartsurf::world

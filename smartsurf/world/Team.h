// The threads of a pool working through one step together: each takes its share of every phase and waits at a
// barrier for the others, also while the first does alone what cannot be shared: to wake a thread takes
// longer. Shares depend on the number of threads, results may not.
#pragma once

#include <hwy/cache_control.h>

#include <algorithm>
#include <atomic>

#include "smartsurf/surface/WorkerPool.h"

namespace smartsurf::world {

// Who waits looks for a while, for phases last microseconds and a sleep costs tens of them; then it sleeps,
// so that another program which has the core of a late member gets done with it meanwhile. Looks that were in
// vain make the next ones shorter, others longer: where programs compete for the cores, looking only keeps
// them all from working.
class Barrier {
 public:
  explicit Barrier(int members) : members_(members) {}
  void wait() {
    if (members_ == 1) return;
    const unsigned round = round_.load(std::memory_order_acquire);
    if (waiting_.fetch_add(1, std::memory_order_acq_rel) + 1 == members_) {
      waiting_.store(0, std::memory_order_relaxed);
      round_.store(round + 1, std::memory_order_release);
      round_.notify_all();
      return;
    }
    const int looks = looks_.load(std::memory_order_relaxed);
    for (int look = 0; look < looks; ++look) {
      if (round_.load(std::memory_order_acquire) != round) {
        if (looks < kMostLooks) looks_.store(looks + kGain, std::memory_order_relaxed);
        return;
      }
      hwy::Pause();
    }
    looks_.store(std::max(kFewestLooks, looks / 2), std::memory_order_relaxed);
    round_.wait(round, std::memory_order_acquire);
  }

 private:
  static constexpr int kFewestLooks = 100, kMostLooks = 2000, kGain = 64;  // a look: some 30 ns
  const int members_;
  std::atomic<int> looks_{kMostLooks};
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
  explicit Team(surface::WorkerPool* pool) : pool_(pool), all_(pool ? pool->threads() : 1) {}

  template <class Work>
  void run(bool shared, Work work) {
    const int members = shared && pool_ ? pool_->threads() : 1;
    if (members == 1) {
      Barrier alone(1);
      work(Member{0, 1, alone});
      return;
    }
    // Two rows a thread: the pool keeps anything smaller on the caller.
    pool_->for_rows(2 * members, [&](int begin, int) { work(Member{begin / 2, members, all_}); });
  }

 private:
  surface::WorkerPool* pool_;
  Barrier all_;
};

}  // namespace smartsurf::world

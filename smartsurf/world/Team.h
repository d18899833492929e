// The threads of a pool working through one step together: each takes its share of every phase and waits at a
// barrier for the others, also while the first does alone what cannot be shared: to wake a thread takes
// longer. Shares depend on the number of threads, results may not.
#pragma once

#include <hwy/cache_control.h>

#include <algorithm>
#include <atomic>
#include <vector>

#include "smartsurf/surface/WorkerPool.h"

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
  explicit Barrier(int members) : place_(static_cast<std::size_t>(members)) {}

  // What the member did so far is seen by all whose wait() comes after this. It must wait() later itself.
  void arrive(int member) {
    Place& mine = place_[static_cast<std::size_t>(member)];
    mine.arrivals.store(mine.arrivals.load(std::memory_order_relaxed) + 1, std::memory_order_release);
    call_sleepers(mine);
  }
  // Until each of the others has arrived as often as this one.
  void wait(int member) {
    Place& mine = place_[static_cast<std::size_t>(member)];
    // Who fell asleep as it arrived is called now: to make sure of it there would cost every arrival a trip
    // between the cores.
    full_fence();
    call_sleepers(mine);
    const unsigned wanted = mine.arrivals.load(std::memory_order_relaxed);
    for (const Place& other : place_)
      if (!other.reached(wanted)) await(other, wanted, mine.looks);
  }

 private:
  static constexpr int kFewestLooks = 100, kMostLooks = 2000, kGain = 64;  // a look: some 30 ns

  // Two lines each: cores fetch lines by twos.
  struct alignas(128) Place {
    std::atomic<unsigned> arrivals{0};
    alignas(128) int looks = kMostLooks;
    bool reached(unsigned wanted) const {
      return static_cast<int>(arrivals.load(std::memory_order_acquire) - wanted) >= 0;
    }
  };

  static void full_fence() {
#ifdef __SANITIZE_THREAD__
#pragma GCC diagnostic ignored "-Wtsan"  // which does not see it; it orders nothing but calls
#endif
    std::atomic_thread_fence(std::memory_order_seq_cst);
  }
  void call_sleepers(Place& mine) {
    if (asleep_.load(std::memory_order_relaxed) > 0) mine.arrivals.notify_all();
  }

  void await(const Place& other, unsigned wanted, int& looks) {
    for (int look = 0; look < looks; ++look) {
      if (other.reached(wanted)) {
        if (looks < kMostLooks) looks += kGain;
        return;
      }
      hwy::Pause();
    }
    looks = std::max(kFewestLooks, looks / 2);
    asleep_.fetch_add(1, std::memory_order_relaxed);
    full_fence();
    while (!other.reached(wanted)) {
      const unsigned so_far = other.arrivals.load(std::memory_order_acquire);
      if (static_cast<int>(so_far - wanted) < 0) other.arrivals.wait(so_far, std::memory_order_acquire);
    }
    asleep_.fetch_sub(1, std::memory_order_relaxed);
  }

  std::vector<Place> place_;
  alignas(128) std::atomic<int> asleep_{0};
};

struct Range {
  int begin, end;
};

struct Member {
  int index, members;
  Barrier& barrier;

  // Whether it is the caller of Team::run.
  bool leads() const { return index + 1 == members; }
  void arrive() const { barrier.arrive(index); }
  void wait() const { barrier.wait(index); }
  void meet() const { arrive(), wait(); }
  // The leader does it, when all have come so far; the others wait until it is done.
  template <class Work>
  void alone(Work work) const {
    meet();
    if (leads()) work();
    meet();
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

  // The pool's first band, which the caller works on, is the last member: members share the table out from
  // the south, bands of rows from the north, and each thread had better find the cells that it moved itself.
  template <class Work>
  void run(bool shared, Work work) {
    const int members = shared && pool_ ? pool_->threads() : 1;
    if (members == 1) {
      work(Member{0, 1, alone_});
      return;
    }
    // Two rows a thread: the pool keeps anything smaller on the caller.
    pool_->for_rows(2 * members, [&](int begin, int) {
      work(Member{members - 1 - begin / 2, members, all_});
    });
  }

 private:
  surface::WorkerPool* pool_;
  Barrier alone_{1}, all_;
};

}  // namespace smartsurf::world

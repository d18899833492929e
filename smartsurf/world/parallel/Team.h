// A team of threads that works through one step together, phase by phase, with a barrier between phases.
//
// Threads stay in the team while one of them does serial work, because waking a thread costs more than the
// wait. Shares depend on the number of members; results must not.
#pragma once

#include "common/threads/ThreadPool.h"
#include "smartsurf/world/parallel/Barrier.h"
#include "smartsurf/world/parallel/IndexRange.h"

namespace smartsurf::world {

// One thread's view of its team. Copies refer to the same barrier.
struct Member {
  int index, member_count;
  Barrier& barrier;

  // True for the thread that called Team::run.
  bool is_caller() const { return index + 1 == member_count; }
  // A single member skips the barrier and its fences.
  void arrive() const {
    if (member_count > 1) barrier.arrive(index);
  }
  void wait() const {
    if (member_count > 1) barrier.wait(index);
  }
  void arrive_and_wait() const { arrive(), wait(); }
  // Runs work() on the caller of Team::run only, with a barrier before and after.
  template <class Work>
  void single(Work work) const {
    arrive_and_wait();
    if (is_caller()) work();
    arrive_and_wait();
  }
  // Runs work() on the caller of Team::run only, between a wait() and an arrive().
  template <class Work>
  void on_caller(Work work) const {
    wait();
    if (is_caller()) work();
    arrive();
  }
  // The member's even share of n items.
  IndexRange share(int n) const {
    return {static_cast<int>(static_cast<long>(n) * index / member_count),
            static_cast<int>(static_cast<long>(n) * (index + 1) / member_count)};
  }
};

class Team {
 public:
  // Without a pool the caller is the only member. `pool` must outlive the team.
  explicit Team(common::ThreadPool* pool) : pool_(pool), team_barrier_(pool ? pool->thread_count() : 1) {}

  int member_count() const { return pool_ ? pool_->thread_count() : 1; }

  // Runs work(member) on all threads at once, or on the caller alone if not `parallel` or while other
  // programs keep the cores busy. Thread 0, the caller, is the last member: members own slabs from south to
  // north and the pool's row bands run from north to south, so each thread finds the cells that it moved
  // itself in its cache.
  template <class Work>
  void run(bool parallel, Work work) {
    const int count = member_count();
    const auto work_as_member = [&](int thread) { work(Member{count - 1 - thread, count, team_barrier_}); };
    const auto work_alone = [&] { work(Member{0, 1, serial_barrier_}); };
    if (parallel && count > 1)
      pool_->fork_join_or(work_as_member, work_alone);
    else
      work_alone();
  }

 private:
  common::ThreadPool* pool_;
  Barrier serial_barrier_{1}, team_barrier_;
};

}  // namespace smartsurf::world

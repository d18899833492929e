// A fixed pool of threads that work on one job at a time. No call allocates; the caller is thread 0.
//
// Work may depend on its index or rows alone, never on the thread or the number of threads, so that results
// are the same for any pool.
#pragma once

#include <atomic>
#include <cstdint>
#include <thread>
#include <vector>

namespace common {

// A hint to the core that this is a spin-wait loop.
inline void spin_pause() noexcept {
#if defined(__x86_64__)
  __builtin_ia32_pause();
#elif defined(__aarch64__)
  asm volatile("yield");
#endif
}

class ThreadPool {
 public:
  // Waking the other threads takes some tens of microseconds: work below this is done before they run.
  static constexpr double kMinParallelCost_ns = 100e3;

  // Starts threads − 1 threads; threads ≥ 1. `min_cost_ns`: see pays(). Throws UserError when
  // the system refuses a thread.
  explicit ThreadPool(int threads, double min_cost_ns = kMinParallelCost_ns);
  ~ThreadPool();
  ThreadPool(const ThreadPool&) = delete;
  ThreadPool& operator=(const ThreadPool&) = delete;

  int thread_count() const noexcept { return static_cast<int>(workers_.size()) + 1; }

  // Returns whether work that takes `cost_ns` on one thread is worth sharing. Callers estimate the cost from
  // counts, never from a clock, so that it is the same in every run.
  bool pays(double cost_ns) const noexcept { return cost_ns >= min_cost_ns_; }

  // Returns whether to share the next job. Other programs may keep the cores busy, so that shared jobs wait
  // for threads without a core and the caller alone is faster. A budget bounds what such waits cost: 1/25 of
  // the time that passes, and kMostBudget_ns at once. While it is spent the caller works alone; empty jobs
  // then show whether the threads have cores again. parallel_for() and parallel_for_rows() call this
  // themselves. It changes no result. A pool with min_cost_ns 0 always shares.
  bool has_cores() noexcept { return !alone_ || shares_again(); }

  // Fork/join: calls work(thread) once on every thread, all at the same time, so that they may wait for each
  // other.
  template <class Work>
  void fork_join(const Work& work) noexcept {
    run({[](const void* of, std::uint32_t thread, unsigned) noexcept {
           (*static_cast<const Work*>(of))(static_cast<int>(thread));
         },
         &work, kEveryThread});
  }

  // Calls work(index, thread) once for every index below `count`. Threads claim indices one by one, so that a
  // thread without a core does not delay the others.
  template <class Work>
  void parallel_for(std::uint32_t count, const Work& work) noexcept {
    if (!has_cores()) {
      for (std::uint32_t index = 0; index < count; ++index) work(index, 0U);
      return;
    }
    run({[](const void* of, std::uint32_t index, unsigned thread) noexcept {
           (*static_cast<const Work*>(of))(index, thread);
         },
         &work, count});
  }

  // Calls work(begin, end) once for each thread's band of rows; the bands cover [0, rows). A band goes to the
  // same thread every time, whose cache holds it. Fewer than two rows per thread stay on the caller.
  template <class Work>
  void parallel_for_rows(int rows, const Work& work) {
    const long n = thread_count();
    if (n == 1 || rows < 2 * n || !has_cores()) {
      if (rows > 0) work(0, rows);
      return;
    }
    fork_join([&work, rows, n](int thread) {
      const int begin = static_cast<int>(rows * static_cast<long>(thread) / n);
      const int end = static_cast<int>(rows * (static_cast<long>(thread) + 1) / n);
      if (begin < end) work(begin, end);
    });
  }

  // The same, on the caller alone where it does not pay.
  template <class Work>
  void parallel_for_rows(int rows, double cost_ns, const Work& work) {
    if (pays(cost_ns))
      parallel_for_rows(rows, work);
    else if (rows > 0)
      work(0, rows);
  }

 private:
  static constexpr std::uint32_t kEveryThread = 0xFFFFFFFF;
  static constexpr std::int64_t kMostBudget_ns = 5'000'000, kBudgetShare = 25;

  struct Job {
    void (*call)(const void* of, std::uint32_t index, unsigned thread) noexcept;
    const void* of;
    std::uint32_t count;  // indices to claim, or kEveryThread
  };

  void run(const Job&) noexcept;
  void work_on(std::uint32_t round, unsigned thread) noexcept;
  void serve(unsigned thread) noexcept;
  void finish_one() noexcept;
  void stop() noexcept;
  void refill_budget(std::int64_t now_ns) noexcept;
  void charge_job(std::int64_t begin_ns, std::int64_t busiest_ns) noexcept;
  bool shares_again() noexcept;
  void wait_while(const std::atomic<std::uint32_t>& word, std::uint32_t old) const noexcept;

  double min_cost_ns_;
  std::int64_t budget_ns_ = kMostBudget_ns;  // that waits for cores may still cost
  std::int64_t refilled_at_ns_ = 0;
  bool alone_ = false;  // the budget is spent
  int spins_;  // before a waiting thread sleeps; 0 where the threads outnumber the cores
  std::vector<std::thread> workers_;
  Job job_{};
  std::atomic<bool> stop_{false};
  // Each has cache lines of its own; cores fetch lines in pairs.
  alignas(128) std::atomic<std::uint32_t> round_{0};  // a new value: a new job, or stop
  // round << 32 | indices not claimed yet, or kEveryThread
  alignas(128) std::atomic<std::uint64_t> claim_{0};
  alignas(128) std::atomic<std::uint32_t> unfinished_{0};  // calls
  std::atomic<std::int64_t> busiest_worker_ns_{0};         // processor time in the job, of a fork/join
};

}  // namespace common

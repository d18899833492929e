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

// Calls of spin_pause() by this thread while it waited for another member of a shared job.
inline thread_local std::int64_t spins_of_this_thread = 0;

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

  // Fork/join: calls work(thread) once on every thread, all at the same time, so that they may wait for each
  // other. Returns false, and calls nothing, where the caller alone is faster: other programs may keep the
  // cores busy, so that shared jobs wait for threads without a core. A budget bounds what such waits cost:
  // 1/25 of the time that passes, and kMostBudget_ns at once. While it is spent no job is shared; empty jobs
  // then show whether the threads have cores again. Threads that wait inside a job count their spins in
  // spins_of_this_thread, so that waiting is not taken for work. This changes no result. A pool with
  // min_cost_ns 0 always shares.
  template <class Work>
  [[nodiscard]] bool try_fork_join(const Work& work) noexcept {
    if (!has_cores()) return false;
    fork_join(work);
    return true;
  }

  // Calls work(index, thread) once for every index below `count`. Threads claim indices one by one, so that a
  // thread without a core does not delay the others. The caller works alone where try_fork_join() would
  // refuse.
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
    const auto work_on_band = [&work, rows, n](int thread) {
      const int begin = static_cast<int>(rows * static_cast<long>(thread) / n);
      const int end = static_cast<int>(rows * (static_cast<long>(thread) + 1) / n);
      if (begin < end) work(begin, end);
    };
    if (n > 1 && rows >= 2 * n && try_fork_join(work_on_band)) return;
    if (rows > 0) work(0, rows);
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

  bool has_cores() noexcept { return !alone_ || shares_again(); }
  template <class Work>
  void fork_join(const Work& work) noexcept {
    run({[](const void* of, std::uint32_t thread, unsigned) noexcept {
           (*static_cast<const Work*>(of))(static_cast<int>(thread));
         },
         &work, kEveryThread});
  }
  void run(const Job&) noexcept;
  std::uint32_t work_on(std::uint32_t round, unsigned thread) noexcept;
  void serve(unsigned thread) noexcept;
  void finish_one() noexcept;
  void stop() noexcept;
  void refill_budget(std::int64_t now_ns) noexcept;
  void charge_job(std::int64_t begin_ns, std::int64_t worked_ns) noexcept;
  bool shares_again() noexcept;
  void wait_while(const std::atomic<std::uint32_t>& word, std::uint32_t old) const noexcept;

  double min_cost_ns_;
  std::int64_t budget_ns_ = kMostBudget_ns;  // that waits for cores may still cost
  std::int64_t refilled_at_ns_ = 0;
  bool alone_ = false;  // the budget is spent
  int spins_;           // before a waiting thread sleeps; 0 where the threads outnumber the cores
  double spin_ns_;      // of one spin_pause()
  std::vector<std::thread> workers_;
  Job job_{};
  std::atomic<bool> stop_{false};
  // Each has cache lines of its own; cores fetch lines in pairs.
  alignas(128) std::atomic<std::uint32_t> round_{0};  // a new value: a new job, or stop
  // round << 32 | indices not claimed yet, or kEveryThread
  alignas(128) std::atomic<std::uint64_t> claim_{0};
  alignas(128) std::atomic<std::uint32_t> unfinished_{0};  // calls
  std::atomic<std::int64_t> worked_ns_{0};  // processor time of all threads but the caller, of a fork/join
};

}  // namespace common

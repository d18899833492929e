// A fixed pool of threads that work on one job at a time. No call allocates; the caller is thread 0.
//
// Work may depend on its index or rows alone, never on the thread or the number of threads, so that results
// are the same for any pool.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <thread>
#include <vector>

#include "common/threads/LossBudget.h"

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

// How a thread waits for another that works on the same job: it looks again and again, for longer than most
// waits take. Returns false after kMaxSpin: then the other thread has no core, and this one had better
// sleep. It does not yield its core in between: where other programs keep the cores busy, it would get it
// back milliseconds later. The first checks have no pause between them: a pause takes longer than a cache
// line takes from core to core.
inline constexpr int kChecksBeforePause = 16, kSpinsPerLook = 64;
inline constexpr std::chrono::microseconds kMaxSpin{200};
template <class Reached>
bool spin_until(const Reached& reached, std::chrono::nanoseconds most = kMaxSpin) noexcept {
  for (int check = 0; check < kChecksBeforePause; ++check)
    if (reached()) return true;
  std::chrono::steady_clock::time_point begin;
  for (bool is_first = true;; is_first = false) {
    for (int spin = 0; spin < kSpinsPerLook; ++spin, ++spins_of_this_thread) {
      if (reached()) return true;
      spin_pause();
    }
    const auto now = std::chrono::steady_clock::now();
    if (is_first) begin = now;
    if (now - begin >= most) return reached();
  }
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

  // Fork/join: calls work(thread) once on every thread, all at the same time, so that they may wait for each
  // other; or calls alone() on the caller where that is faster, because other programs keep the cores busy.
  // Returns whether the job was shared. It changes no result.
  //
  // A job is shared only if all threads come within kMaxDelay of its start, so that the caller never waits
  // for one that has no core then. A thread may still lose its core within a job: see LossBudget. Threads
  // that wait inside a job count their spins in spins_of_this_thread, so that waiting is not taken for work.
  //
  // A pool with min_cost_ns 0 always shares.
  template <class Work, class Alone>
  bool fork_join_or(const Work& work, const Alone& alone) {
    if (has_cores()) {
      const Job job{[](const void* of, std::uint32_t thread, unsigned) noexcept {
                      (*static_cast<const Work*>(of))(static_cast<int>(thread));
                    },
                    &work, kEveryThread};
      if (run(job)) return true;
      alone();
    } else {
      work_alone(alone);
    }
    return false;
  }

  // Calls work(index, thread) once for every index below `count`, which is less than 2³¹. Threads claim
  // indices one by one, so that a thread without a core delays the others by one index at most. The caller
  // works alone after a loss.
  template <class Work>
  void parallel_for(std::uint32_t count, const Work& work) noexcept {
    if (is_single() || is_pause())
      return work_alone([&] {
        for (std::uint32_t index = 0; index < count; ++index) work(index, 0U);
      });
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
    const auto work_on_all = [&work, rows] {
      if (rows > 0) work(0, rows);
    };
    if (rows < 2 * n) return work_on_all();
    fork_join_or(work_on_band, work_on_all);
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
  // In `claim_`, beside the number of threads that have not come yet.
  static constexpr std::uint32_t kEveryThread = 0x8000'0000;
  static constexpr std::chrono::microseconds kMaxDelay{100};  // of a thread, at the start of a job
  static constexpr std::int64_t kWorkAlone_percent = 85;      // of the work of all threads

  struct Job {
    void (*call)(const void* of, std::uint32_t index, unsigned thread) noexcept;
    const void* of;
    std::uint32_t count;  // indices to claim, or kEveryThread
  };

  bool is_single() const noexcept { return workers_.empty(); }
  bool always_shares() const noexcept { return min_cost_ns_ == 0.0; }
  bool has_cores() noexcept;
  bool is_pause() const noexcept;
  static std::int64_t now_ns() noexcept;
  static std::int64_t cpu_ns() noexcept;  // of this thread
  template <class Alone>
  void work_alone(const Alone& alone) {
    if (is_single()) return alone();
    const bool is_measured = budget_.is_measurement_due();
    const std::int64_t begin_ns = now_ns(), begin_cpu_ns = is_measured ? cpu_ns() : 0;
    alone();
    const std::int64_t own_ns = is_measured ? cpu_ns() - begin_cpu_ns : 0, wall_ns = now_ns() - begin_ns;
    if (is_measured)
      budget_.record_serial(wall_ns, own_ns);
    else
      budget_.record_unmeasured(wall_ns);
  }
  bool run(const Job&) noexcept;
  bool all_come(std::uint32_t round) noexcept;
  bool come(std::uint32_t round) noexcept;
  std::uint32_t work_on(std::uint32_t round, unsigned thread) noexcept;
  void serve(unsigned thread) noexcept;
  void finish_one() noexcept;
  void stop() noexcept;
  template <class Word>
  void wait_while(const std::atomic<Word>& word, Word old) const noexcept;

  double min_cost_ns_;
  LossBudget budget_;
  bool spins_;      // a waiting thread does so first: the threads do not outnumber the cores
  double spin_ns_;  // of one spin_pause()
  std::vector<std::thread> workers_;
  Job job_{};
  std::atomic<int> caller_core_{-1};  // at the start of the job
  std::atomic<bool> stop_{false};
  // Each has cache lines of its own; cores fetch lines in pairs.
  alignas(128) std::atomic<std::uint32_t> round_{0};  // a new value: a new job, or stop
  // round << 32 | indices not claimed yet, or kEveryThread + threads that have not come yet, or 0 if they
  // came late
  alignas(128) std::atomic<std::uint64_t> claim_{0};
  alignas(128) std::atomic<std::uint32_t> unfinished_{0};  // calls
  std::atomic<std::int64_t> worked_ns_{0};  // processor time of all threads but the caller, of a fork/join
};

}  // namespace common

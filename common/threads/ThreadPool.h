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

// How a thread waits for another that works on the same job: it looks again and again, for longer than most waits
// take; in between, from kSpinsPerYield on, it yields its core, which the other may be waiting for. Returns false
// after kMostSpin_ns: then the other thread has no core, and this one had better sleep.
inline constexpr int kSpinsPerYield = 64;
inline constexpr std::chrono::microseconds kMostSpin{200};
template <class Reached>
bool spin_until(const Reached& reached) noexcept {
  std::chrono::steady_clock::time_point begin;
  for (bool is_first = true;; is_first = false) {
    for (int spin = 0; spin < kSpinsPerYield; ++spin, ++spins_of_this_thread) {
      if (reached()) return true;
      spin_pause();
    }
    const auto now = std::chrono::steady_clock::now();
    if (is_first) begin = now;
    if (now - begin >= kMostSpin) return reached();
    std::this_thread::yield();
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
  // other. Returns false, and calls nothing, where the caller alone is faster: other programs may keep the
  // cores busy, so that shared jobs wait for threads without a core. Where shared jobs have lost kMostLoss_ns
  // against the caller alone, the pool backs off: it shares none for kFirstPause_ns, twice as long each time that
  // it loses as much again, up to kMostPause_ns. Threads that wait inside a job count their spins in
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
  static constexpr std::int64_t kMostLoss_ns = 1'000'000;
  static constexpr std::int64_t kFirstPause_ns = 30'000'000, kMostPause_ns = 1'000'000'000;

  struct Job {
    void (*call)(const void* of, std::uint32_t index, unsigned thread) noexcept;
    const void* of;
    std::uint32_t count;  // indices to claim, or kEveryThread
  };

  bool has_cores() noexcept { return !is_paused_ || ends_pause(); }
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
  void charge_job(std::int64_t begin_ns, std::int64_t worked_ns) noexcept;
  bool ends_pause() noexcept;
  void wait_while(const std::atomic<std::uint32_t>& word, std::uint32_t old) const noexcept;

  double min_cost_ns_;
  std::int64_t lost_ns_ = 0;  // by shared jobs, since they last gained as much
  bool is_paused_ = false;
  std::int64_t pause_ns_ = 0, pause_end_ns_ = 0;  // of the latest pause; 0 if jobs have gained for as long since
  bool spins_;                                    // a waiting thread does so first: the threads do not outnumber the cores
  double spin_ns_;                                // of one spin_pause(), with its share of the yields
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

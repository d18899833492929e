// A small fixed pool that cuts a range of rows into one band a thread. Work on a band may depend on the rows
// alone, never on the band, so that results are the same for any number of threads.
#pragma once

#include <memory>

namespace smartsurf::surface {

class ThreadPool {
 public:
  // Waking the others takes some tens of microseconds; less work than this is done before they are up.
  static constexpr double kMinParallelCost_ns = 100e3;

  // Starts threads − 1 threads (the caller is one of them); threads ≥ 1. They share work that costs at least
  // worth_ns.
  explicit ThreadPool(int threads, double min_parallel_cost_ns = kMinParallelCost_ns);
  ~ThreadPool();
  ThreadPool(const ThreadPool&) = delete;
  ThreadPool& operator=(const ThreadPool&) = delete;

  int thread_count() const noexcept;

  // Calls work(begin, end) once a band, together covering [0, rows), and returns when all are done. One
  // caller at a time. Work with fewer than two rows a thread runs on the caller alone. Does not allocate.
  template <class Work>
  void parallel_for_rows(int rows, const Work& work) {
    run_bands(rows, {&work, [](const void* context, int begin, int end) {
                       (*static_cast<const Work*>(context))(begin, end);
                     }});
  }

  // The same, on the caller alone where it is not worth sharing. cost_ns: about what all the work takes one
  // thread, reckoned from counts of what there is to do, never from a clock.
  template <class Work>
  void parallel_for_rows(int rows, double cost_ns, const Work& work) {
    if (cost_ns >= min_parallel_cost_ns_)
      parallel_for_rows(rows, work);
    else if (rows > 0)
      work(0, rows);
  }

 private:
  struct Job {
    const void* context = nullptr;
    void (*function)(const void* of, int begin, int end) = nullptr;
  };
  struct State;
  void run_bands(int rows, Job);

  std::unique_ptr<State> state_;
  double min_parallel_cost_ns_;
};

}  // namespace smartsurf::surface

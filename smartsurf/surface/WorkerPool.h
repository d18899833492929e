// A small fixed pool that cuts a range of rows into one band a thread. Work on a band may depend on the rows
// alone, never on the band, so that results are the same for any number of threads.
#pragma once

#include <memory>

namespace smartsurf::surface {

class WorkerPool {
 public:
  // Waking the others takes some tens of microseconds; less work than this is done before they are up.
  static constexpr double kWorthSharing_ns = 100e3;

  // Starts threads − 1 threads (the caller is one of them); threads ≥ 1.
  explicit WorkerPool(int threads);
  ~WorkerPool();
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

  int threads() const noexcept;

  // Calls work(begin, end) once a band, together covering [0, rows), and returns when all are done. One
  // caller at a time. Work with fewer than two rows a thread runs on the caller alone. Does not allocate.
  template <class Work>
  void for_rows(int rows, const Work& work) {
    share(rows,
          {&work, [](const void* of, int begin, int end) { (*static_cast<const Work*>(of))(begin, end); }});
  }

  // The same, on the caller alone where it is not worth sharing. cost_ns: about what all the work takes one
  // thread, reckoned from counts of what there is to do, never from a clock.
  template <class Work>
  void for_rows(int rows, double cost_ns, const Work& work) {
    if (cost_ns >= kWorthSharing_ns)
      for_rows(rows, work);
    else if (rows > 0)
      work(0, rows);
  }

 private:
  struct Job {
    const void* of = nullptr;
    void (*work)(const void* of, int begin, int end) = nullptr;
  };
  struct State;
  void share(int rows, Job);

  std::unique_ptr<State> state_;
};

}  // namespace smartsurf::surface

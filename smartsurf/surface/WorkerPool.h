// A small fixed pool that cuts a range of rows into one band a thread. Work on a band may depend on the rows
// alone, never on the band, so that results are the same for any number of threads.
#pragma once

#include <functional>
#include <memory>

namespace smartsurf::surface {

class WorkerPool {
 public:
  // Starts threads − 1 threads (the caller is one of them); threads ≥ 1.
  explicit WorkerPool(int threads);
  ~WorkerPool();
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

  int threads() const noexcept;

  // Calls work(begin, end) once a band, together covering [0, rows), and returns when all are done. One caller
  // at a time. Work with fewer than two rows a thread runs on the caller alone. Does not allocate.
  void for_rows(int rows, const std::function<void(int begin, int end)>& work);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace smartsurf::surface

// Runs kernels over whole planes, split by rows over the VM's threads. Chunks of rows are disjoint, so
// results do not depend on the number of threads.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>

#include "apron/vm/kernels/KernelTable.h"
#include "common/threads/ThreadPool.h"

namespace apron::vm {

class Executor {
 public:
  // `threads` includes the caller's and is at least 1. Planes with fewer cells than `parallel_cells` run on
  // the calling thread, because waking another one would take longer. `stop` may be null.
  Executor(const KernelTable& kernels, unsigned threads, std::size_t parallel_cells,
           const std::atomic<bool>* stop = nullptr)
      : kernels_(kernels), parallel_cells_(parallel_cells), stop_(stop), pool_(static_cast<int>(threads)) {}

  const KernelTable& kernels() const noexcept { return kernels_; }
  // Operations that take seconds poll this, and leave the rest of their cells as they are.
  bool is_stopped() const noexcept { return stop_ != nullptr && stop_->load(std::memory_order_relaxed); }

  void run_kernel(Kernel kernel, const Block& block) noexcept {
    if (runs_sequentially(block.rows, block.columns)) return kernel(block);
    run_parallel(kernel, block);
  }

  // Calls work(first, last) for disjoint row ranges [first, last) that cover an array of rows x columns.
  // Returns when all are done. Does not allocate.
  template <class Work>
  void parallel_for_rows(std::uint32_t rows, std::uint32_t columns, const Work& work) noexcept {
    if (runs_sequentially(rows, columns)) return work(0U, rows);
    const auto count = static_cast<std::uint32_t>(pool_.thread_count());
    parallel_for(count, [&](std::uint32_t chunk, unsigned) {
      const auto first = static_cast<std::uint32_t>(std::size_t{rows} * chunk / count);
      const auto last = static_cast<std::uint32_t>(std::size_t{rows} * (chunk + 1) / count);
      if (first < last) work(first, last);
    });
  }

  // Calls work(chunk, thread) once for each chunk in [0, count); the caller is thread 0. Returns when all are
  // done. Does not allocate.
  template <class Work>
  void parallel_for(std::uint32_t count, const Work& work) noexcept {
    pool_.parallel_for(count, work);
  }

 private:
  bool runs_sequentially(std::uint32_t rows, std::uint32_t columns) const noexcept {
    return pool_.thread_count() == 1 || std::size_t{rows} * columns < parallel_cells_;
  }
  void run_parallel(Kernel kernel, const Block& block) noexcept;

  const KernelTable& kernels_;
  std::size_t parallel_cells_;
  const std::atomic<bool>* stop_;
  common::ThreadPool pool_;
};

// y = a, both of one shape and of any types. mask is null or has y's cells and pitch.
void convert_plane(Executor& executor, Plane y, ConstPlane a, bool saturated = false,
                   const float* mask = nullptr) noexcept;

}  // namespace apron::vm

// Runs kernels over whole planes, by row slices on the VM's threads. Slices never share a row, so the number
// of threads cannot change a result.
#pragma once

#include <cstdint>
#include <memory>
#include <thread>
#include <vector>

#include <atomic>

#include "apron/vm/kernels/Kernels.h"

namespace apron::vm {

class Executor {
 public:
  // threads: at least 1, the caller's included. Planes of fewer than parallel_cells cells stay on the
  // caller's thread: below that, waking another costs more than it gains.
  Executor(const KernelTable& kernels, unsigned threads, std::size_t parallel_cells);
  ~Executor();
  Executor(const Executor&) = delete;
  Executor& operator=(const Executor&) = delete;

  const KernelTable& kernels() const noexcept { return kernels_; }

  void run_kernel(Kernel kernel, const Block& block) noexcept {
    if (runs_sequentially(block.rows, block.columns)) return kernel(block);
    run_parallel(kernel, block);
  }

  // work(first, last): rows [first, last) of an array of rows x columns. Blocks until all are done; no
  // allocation.
  template <class Work>
  void parallel_for_rows(std::uint32_t rows, std::uint32_t columns, const Work& work) noexcept {
    if (runs_sequentially(rows, columns)) return work(0U, rows);
    const std::uint32_t count = thread_count();
    parallel_for(count, [&](std::uint32_t chunk, unsigned) {
      const auto first = static_cast<std::uint32_t>(std::size_t{rows} * chunk / count);
      const auto last = static_cast<std::uint32_t>(std::size_t{rows} * (chunk + 1) / count);
      if (first < last) work(first, last);
    });
  }

  // work(piece, thread): each piece below count once, on the thread of that number; the caller's is 0. Blocks
  // until all are done; no allocation.
  template <class Work>
  void parallel_for(std::uint32_t count, const Work& work) noexcept {
    run_task({[](const void* w, std::uint32_t piece, unsigned thread) noexcept {
                (*static_cast<const Work*>(w))(piece, thread);
              },
              &work, count});
  }

 private:
  struct Task {
    void (*invoke)(const void*, std::uint32_t, unsigned) noexcept;
    const void* context;
    std::uint32_t chunks;
  };
  bool runs_sequentially(std::uint32_t rows, std::uint32_t columns) const noexcept {
    return workers_.empty() || std::size_t{rows} * columns < parallel_cells_;
  }
  void run_parallel(Kernel kernel, const Block& block) noexcept;
  void run_task(const Task& task) noexcept;
  void claim_chunks(std::uint32_t generation, unsigned thread) noexcept;
  void worker_loop(unsigned thread) noexcept;
  std::uint32_t thread_count() const noexcept { return static_cast<std::uint32_t>(workers_.size() + 1); }

  const KernelTable& kernels_;
  std::size_t parallel_cells_;
  std::vector<std::thread> workers_;
  Task task_{};
  std::atomic<bool> stop_{false};
  alignas(128) std::atomic<std::uint32_t> generation_{0};  // a new value: a new job, or stop
  alignas(128) std::atomic<std::uint64_t> unclaimed_{0};   // its round, and how many pieces nobody has taken
  alignas(128) std::atomic<std::uint32_t> unfinished_chunks_{0};  // pieces
};

}  // namespace apron::vm

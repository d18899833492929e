// Runs kernels over whole planes, by row slices on the VM's threads. Slices never share a row, so the number
// of threads cannot change a result.
#pragma once

#include <cstdint>
#include <memory>
#include <thread>
#include <vector>

#include <atomic>

#include "apron/vm/Kernels.h"

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

  void run(Kernel kernel, const Block& block) noexcept {
    if (stays_here(block.rows, block.columns)) return kernel(block);
    run_sliced(kernel, block);
  }

  // work(first, last): rows [first, last) of an array of rows x columns. Blocks until all are done; no
  // allocation.
  template <class Work>
  void rows(std::uint32_t rows, std::uint32_t columns, const Work& work) noexcept {
    if (stays_here(rows, columns)) return work(0U, rows);
    const std::uint32_t count = threads();
    pieces(count, [&](std::uint32_t piece, unsigned) {
      const auto first = static_cast<std::uint32_t>(std::size_t{rows} * piece / count);
      const auto last = static_cast<std::uint32_t>(std::size_t{rows} * (piece + 1) / count);
      if (first < last) work(first, last);
    });
  }

  // work(piece, thread): each piece below count once, on the thread of that number; the caller's is 0. Blocks
  // until all are done; no allocation.
  template <class Work>
  void pieces(std::uint32_t count, const Work& work) noexcept {
    run_job({[](const void* w, std::uint32_t piece, unsigned thread) noexcept {
               (*static_cast<const Work*>(w))(piece, thread);
             },
             &work, count});
  }

 private:
  struct Job {
    void (*call)(const void*, std::uint32_t, unsigned) noexcept;
    const void* work;
    std::uint32_t pieces;
  };
  bool stays_here(std::uint32_t rows, std::uint32_t columns) const noexcept {
    return workers_.empty() || std::size_t{rows} * columns < parallel_cells_;
  }
  void run_sliced(Kernel kernel, const Block& block) noexcept;
  void run_job(const Job& job) noexcept;
  void take_pieces(std::uint32_t round, unsigned thread) noexcept;
  void serve(unsigned thread) noexcept;
  std::uint32_t threads() const noexcept { return static_cast<std::uint32_t>(workers_.size() + 1); }

  const KernelTable& kernels_;
  std::size_t parallel_cells_;
  std::vector<std::thread> workers_;
  Job job_{};
  std::atomic<bool> stop_{false};
  alignas(128) std::atomic<std::uint32_t> round_{0};       // a new value: a new job, or stop
  alignas(128) std::atomic<std::uint64_t> claim_{0};       // its round, and how many pieces nobody has taken
  alignas(128) std::atomic<std::uint32_t> unfinished_{0};  // pieces
};

}  // namespace apron::vm

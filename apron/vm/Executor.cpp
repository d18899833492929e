#include "apron/vm/Executor.h"

namespace apron::vm {
namespace {

// A job takes microseconds, and waking a sleeping thread tens of them: look a while before sleeping.
constexpr int kSpins = 4000;

void wait_while(const std::atomic<std::uint32_t>& word, std::uint32_t old) noexcept {
  for (int i = 0; i < kSpins; ++i) {
    if (word.load(std::memory_order_acquire) != old) return;
#if defined(__x86_64__)
    __builtin_ia32_pause();
#endif
  }
  word.wait(old, std::memory_order_acquire);
}

}  // namespace

Executor::Executor(const KernelTable& kernels, unsigned threads, std::size_t parallel_cells)
    : kernels_(kernels), parallel_cells_(parallel_cells) {
  for (unsigned slice = 1; slice < threads; ++slice) workers_.emplace_back([this, slice] { serve(slice); });
}

Executor::~Executor() {
  stop_ = true;
  round_.fetch_add(1, std::memory_order_release);
  round_.notify_all();
  for (std::thread& worker : workers_) worker.join();
}

void Executor::run_sliced(Kernel kernel, const Block& block) noexcept {
  rows(block.rows, block.columns, [&](std::uint32_t first, std::uint32_t last) {
    Block slice = block;
    const auto rows_down = static_cast<std::ptrdiff_t>(first);
    slice.rows = last - first;
    slice.y += rows_down * block.pitch;
    for (std::size_t k = 0; k < slice.source.size(); ++k)
      if (slice.source[k] != nullptr) slice.source[k] += rows_down * block.source_pitch[k];
    if (slice.mask != nullptr) slice.mask += rows_down * block.mask_pitch;
    kernel(slice);
  });
}

void Executor::run_job(const Job& job) noexcept {
  job_ = job;
  pending_.store(static_cast<std::uint32_t>(workers_.size()), std::memory_order_relaxed);
  round_.fetch_add(1, std::memory_order_release);
  round_.notify_all();
  run_slice(job, 0);
  for (std::uint32_t left = pending_.load(std::memory_order_acquire); left != 0;
       left = pending_.load(std::memory_order_acquire))
    wait_while(pending_, left);
}

void Executor::run_slice(const Job& job, unsigned slice) const noexcept {
  const std::size_t slices = workers_.size() + 1;
  const auto first = static_cast<std::uint32_t>(std::size_t{job.rows} * slice / slices);
  const auto last = static_cast<std::uint32_t>(std::size_t{job.rows} * (slice + 1) / slices);
  if (first < last) job.call(job.work, first, last);
}

void Executor::serve(unsigned slice) noexcept {
  std::uint32_t round = 0;
  for (;;) {
    wait_while(round_, round++);
    if (stop_) return;
    run_slice(job_, slice);
    if (pending_.fetch_sub(1, std::memory_order_acq_rel) == 1) pending_.notify_one();
  }
}

}  // namespace apron::vm

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
  for (unsigned slice = 1; slice < threads; ++slice) workers_.emplace_back([this] { serve(); });
}

Executor::~Executor() {
  stop_.store(true, std::memory_order_release);
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

// Slices are taken, not dealt: a thread that the machine is too busy to run holds nobody up, for the caller
// takes what is left.
void Executor::run_job(const Job& job) noexcept {
  job_ = job;
  const std::uint32_t round = round_.load(std::memory_order_relaxed) + 1;
  unfinished_.store(slices(), std::memory_order_relaxed);
  claim_.store(std::uint64_t{round} << 32U, std::memory_order_release);
  round_.store(round, std::memory_order_release);
  round_.notify_all();
  take_slices(round);
  for (std::uint32_t left = unfinished_.load(std::memory_order_acquire); left != 0;
       left = unfinished_.load(std::memory_order_acquire))
    wait_while(unfinished_, left);
}

// Runs slices of this round's job while there are any; job_ stays what it is until all that were taken are
// done.
void Executor::take_slices(std::uint32_t round) noexcept {
  std::uint64_t claim = claim_.load(std::memory_order_acquire);
  for (;;) {
    const auto slice = static_cast<std::uint32_t>(claim);
    if (claim >> 32U != round || slice >= slices()) return;
    if (!claim_.compare_exchange_weak(claim, claim + 1, std::memory_order_acq_rel)) continue;
    run_slice(job_, slice);
    if (unfinished_.fetch_sub(1, std::memory_order_acq_rel) == 1) unfinished_.notify_one();
    claim = claim_.load(std::memory_order_acquire);
  }
}

void Executor::run_slice(const Job& job, unsigned slice) const noexcept {
  const auto first = static_cast<std::uint32_t>(std::size_t{job.rows} * slice / slices());
  const auto last = static_cast<std::uint32_t>(std::size_t{job.rows} * (slice + 1) / slices());
  if (first < last) job.call(job.work, first, last);
}

void Executor::serve() noexcept {
  std::uint32_t round = 0;
  for (;;) {
    wait_while(round_, round);
    round = round_.load(std::memory_order_acquire);
    if (stop_.load(std::memory_order_acquire)) return;
    take_slices(round);
  }
}

}  // namespace apron::vm

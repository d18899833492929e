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
  for (unsigned thread = 1; thread < threads; ++thread)
    workers_.emplace_back([this, thread] { serve(thread); });
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

// Pieces are taken, not dealt: a thread that the machine is too busy to run holds nobody up, for the others
// take what is left.
void Executor::run_job(const Job& job) noexcept {
  job_ = job;
  const std::uint32_t round = round_.load(std::memory_order_relaxed) + 1;
  unfinished_.store(job.pieces, std::memory_order_relaxed);
  claim_.store(std::uint64_t{round} << 32U | job.pieces, std::memory_order_release);
  round_.store(round, std::memory_order_release);
  round_.notify_all();
  take_pieces(round, 0);
  for (std::uint32_t left = unfinished_.load(std::memory_order_acquire); left != 0;
       left = unfinished_.load(std::memory_order_acquire))
    wait_while(unfinished_, left);
}

// Runs pieces of this round's job while there are any; job_ stays what it is until all that were taken are
// done.
void Executor::take_pieces(std::uint32_t round, unsigned thread) noexcept {
  std::uint64_t claim = claim_.load(std::memory_order_acquire);
  for (;;) {
    const auto left = static_cast<std::uint32_t>(claim);
    if (claim >> 32U != round || left == 0) return;
    if (!claim_.compare_exchange_weak(claim, claim - 1, std::memory_order_acq_rel)) continue;
    job_.call(job_.work, job_.pieces - left, thread);
    if (unfinished_.fetch_sub(1, std::memory_order_acq_rel) == 1) unfinished_.notify_one();
    claim = claim_.load(std::memory_order_acquire);
  }
}

void Executor::serve(unsigned thread) noexcept {
  std::uint32_t round = 0;
  for (;;) {
    wait_while(round_, round);
    round = round_.load(std::memory_order_acquire);
    if (stop_.load(std::memory_order_acquire)) return;
    take_pieces(round, thread);
  }
}

}  // namespace apron::vm

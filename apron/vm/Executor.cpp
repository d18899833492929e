#include "apron/vm/Executor.h"

namespace apron::vm {
namespace {

// A job takes microseconds, and waking a sleeping thread tens of them: look a while before sleeping.
constexpr int kMaxSpins = 4000;

void spin_then_wait(const std::atomic<std::uint32_t>& word, std::uint32_t old) noexcept {
  for (int i = 0; i < kMaxSpins; ++i) {
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
    workers_.emplace_back([this, thread] { worker_loop(thread); });
}

Executor::~Executor() {
  stop_.store(true, std::memory_order_release);
  generation_.fetch_add(1, std::memory_order_release);
  generation_.notify_all();
  for (std::thread& worker : workers_) worker.join();
}

void Executor::run_parallel(Kernel kernel, const Block& block) noexcept {
  parallel_for_rows(block.rows, block.columns, [&](std::uint32_t first, std::uint32_t last) {
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
void Executor::run_task(const Task& task) noexcept {
  task_ = task;
  const std::uint32_t generation = generation_.load(std::memory_order_relaxed) + 1;
  unfinished_chunks_.store(task.chunks, std::memory_order_relaxed);
  unclaimed_.store(std::uint64_t{generation} << 32U | task.chunks, std::memory_order_release);
  generation_.store(generation, std::memory_order_release);
  generation_.notify_all();
  claim_chunks(generation, 0);
  for (std::uint32_t left = unfinished_chunks_.load(std::memory_order_acquire); left != 0;
       left = unfinished_chunks_.load(std::memory_order_acquire))
    spin_then_wait(unfinished_chunks_, left);
}

// Runs pieces of this round's job while there are any; job_ stays what it is until all that were taken are
// done.
void Executor::claim_chunks(std::uint32_t generation, unsigned thread) noexcept {
  std::uint64_t claim = unclaimed_.load(std::memory_order_acquire);
  for (;;) {
    const auto left = static_cast<std::uint32_t>(claim);
    if (claim >> 32U != generation || left == 0) return;
    if (!unclaimed_.compare_exchange_weak(claim, claim - 1, std::memory_order_acq_rel)) continue;
    task_.invoke(task_.context, task_.chunks - left, thread);
    if (unfinished_chunks_.fetch_sub(1, std::memory_order_acq_rel) == 1) unfinished_chunks_.notify_one();
    claim = unclaimed_.load(std::memory_order_acquire);
  }
}

void Executor::worker_loop(unsigned thread) noexcept {
  std::uint32_t generation = 0;
  for (;;) {
    spin_then_wait(generation_, generation);
    generation = generation_.load(std::memory_order_acquire);
    if (stop_.load(std::memory_order_acquire)) return;
    claim_chunks(generation, thread);
  }
}

}  // namespace apron::vm

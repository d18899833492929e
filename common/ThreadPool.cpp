#include "common/ThreadPool.h"

#include <hwy/cache_control.h>

#include <algorithm>
#include <atomic>
#include <thread>
#include <vector>

namespace smartsurf::surface {
namespace {

// The phases of a tick follow each other closely: who waits looks for so many turns, some 20 µs, before it
// sleeps, for being woken takes longer than that.
constexpr int kSpinIterations = 1500;

}  // namespace

struct ThreadPool::State {
  std::vector<std::thread> threads;
  int spin_iterations =
      0;  // none where the threads outnumber the cores: who looks keeps another from working
  Job job;
  int rows = 0;
  // Each on its own line: the caller writes one, the others the other.
  alignas(128) std::atomic<unsigned> generation{0};
  alignas(128) std::atomic<int> pending{0};
  std::atomic<bool> stopping{false};

  int thread_count() const { return static_cast<int>(threads.size()) + 1; }

  void run_band(int band) const {
    const long n = thread_count();
    const int begin = static_cast<int>(rows * static_cast<long>(band) / n);
    const int end = static_cast<int>(rows * (static_cast<long>(band) + 1) / n);
    if (begin < end) job.function(job.context, begin, end);
  }

  // Until the value is no more what it was.
  template <class T>
  void spin_then_wait(const std::atomic<T>& value, T old_value) const {
    for (int spin = 0; spin < spin_iterations; ++spin) {
      if (value.load(std::memory_order_acquire) != old_value) return;
      hwy::Pause();
    }
    value.wait(old_value, std::memory_order_acquire);
  }

  void worker_loop(int band) {
    for (unsigned seen = 0;; ++seen) {
      spin_then_wait(generation, seen);
      if (stopping) return;
      run_band(band);
      if (pending.fetch_sub(1, std::memory_order_acq_rel) == 1) pending.notify_one();
    }
  }
};

ThreadPool::ThreadPool(int threads, double min_parallel_cost_ns)
    : state_(std::make_unique<State>()), min_parallel_cost_ns_(min_parallel_cost_ns) {
  const int worker_count = std::max(0, threads - 1);
  if (static_cast<unsigned>(threads) <= std::thread::hardware_concurrency())
    state_->spin_iterations = kSpinIterations;
  // All are there before any works: a band depends on how many there are.
  state_->threads.resize(static_cast<std::size_t>(worker_count));
  for (int i = 0; i < worker_count; ++i)
    state_->threads[static_cast<std::size_t>(i)] =
        std::thread([s = state_.get(), i] { s->worker_loop(i + 1); });
}

ThreadPool::~ThreadPool() {
  state_->stopping = true;
  ++state_->generation;
  state_->generation.notify_all();
  for (auto& t : state_->threads) t.join();
}

int ThreadPool::thread_count() const noexcept { return state_->thread_count(); }

void ThreadPool::run_bands(int rows, Job job) {
  if (state_->threads.empty() || rows < 2 * state_->thread_count()) {
    if (rows > 0) job.function(job.context, 0, rows);
    return;
  }
  state_->job = job;
  state_->rows = rows;
  state_->pending.store(static_cast<int>(state_->threads.size()), std::memory_order_relaxed);
  state_->generation.fetch_add(1, std::memory_order_release);
  state_->generation.notify_all();
  state_->run_band(0);
  for (int pending; (pending = state_->pending.load(std::memory_order_acquire)) > 0;)
    state_->spin_then_wait(state_->pending, pending);
}

}  // namespace smartsurf::surface

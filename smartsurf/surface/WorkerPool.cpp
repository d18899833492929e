#include "smartsurf/surface/WorkerPool.h"

#include <hwy/cache_control.h>

#include <algorithm>
#include <atomic>
#include <thread>
#include <vector>

namespace smartsurf::surface {
namespace {

// The phases of a tick follow each other closely: who waits looks for so many turns, some 20 µs, before it
// sleeps, for being woken takes longer than that.
constexpr int kTurns = 1500;

}  // namespace

struct WorkerPool::State {
  std::vector<std::thread> threads;
  int turns = 0;  // none where the threads outnumber the cores: who looks keeps another from working
  Job job;
  int rows = 0;
  // Each on its own line: the caller writes one, the others the other.
  alignas(128) std::atomic<unsigned> round{0};
  alignas(128) std::atomic<int> pending{0};
  std::atomic<bool> stopping{false};

  int bands() const { return static_cast<int>(threads.size()) + 1; }

  void run_band(int band) const {
    const long n = bands();
    const int begin = static_cast<int>(rows * static_cast<long>(band) / n);
    const int end = static_cast<int>(rows * (static_cast<long>(band) + 1) / n);
    if (begin < end) job.work(job.of, begin, end);
  }

  // Until the value is no more what it was.
  template <class T>
  void await_change(const std::atomic<T>& value, T from) const {
    for (int turn = 0; turn < turns; ++turn) {
      if (value.load(std::memory_order_acquire) != from) return;
      hwy::Pause();
    }
    value.wait(from, std::memory_order_acquire);
  }

  void serve(int band) {
    for (unsigned seen = 0;; ++seen) {
      await_change(round, seen);
      if (stopping) return;
      run_band(band);
      if (pending.fetch_sub(1, std::memory_order_acq_rel) == 1) pending.notify_one();
    }
  }
};

WorkerPool::WorkerPool(int threads) : state_(std::make_unique<State>()) {
  const int others = std::max(0, threads - 1);
  if (static_cast<unsigned>(threads) <= std::thread::hardware_concurrency()) state_->turns = kTurns;
  // All are there before any works: a band depends on how many there are.
  state_->threads.resize(static_cast<std::size_t>(others));
  for (int i = 0; i < others; ++i)
    state_->threads[static_cast<std::size_t>(i)] = std::thread([s = state_.get(), i] { s->serve(i + 1); });
}

WorkerPool::~WorkerPool() {
  state_->stopping = true;
  ++state_->round;
  state_->round.notify_all();
  for (auto& t : state_->threads) t.join();
}

int WorkerPool::threads() const noexcept { return state_->bands(); }

void WorkerPool::share(int rows, Job job) {
  if (state_->threads.empty() || rows < 2 * state_->bands()) {
    if (rows > 0) job.work(job.of, 0, rows);
    return;
  }
  state_->job = job;
  state_->rows = rows;
  state_->pending.store(static_cast<int>(state_->threads.size()), std::memory_order_relaxed);
  state_->round.fetch_add(1, std::memory_order_release);
  state_->round.notify_all();
  state_->run_band(0);
  for (int left; (left = state_->pending.load(std::memory_order_acquire)) > 0;)
    state_->await_change(state_->pending, left);
}

}  // namespace smartsurf::surface

#include "smartsurf/surface/WorkerPool.h"

#include <algorithm>
#include <condition_variable>
#include <mutex>
#include <thread>
#include <vector>

namespace smartsurf::surface {

struct WorkerPool::State {
  std::vector<std::thread> threads;
  std::mutex mutex;
  std::condition_variable start, done;
  const std::function<void(int, int)>* work = nullptr;
  int rows = 0;
  int pending = 0;
  unsigned long round = 0;
  bool stopping = false;

  int bands() const { return static_cast<int>(threads.size()) + 1; }

  void run_band(const std::function<void(int, int)>& job, int total_rows, int band) const {
    const long n = bands();
    const int begin = static_cast<int>(total_rows * static_cast<long>(band) / n);
    const int end = static_cast<int>(total_rows * (static_cast<long>(band) + 1) / n);
    if (begin < end) job(begin, end);
  }

  void serve(int band) {
    unsigned long seen = 0;
    std::unique_lock lock(mutex);
    while (true) {
      start.wait(lock, [&] { return stopping || round != seen; });
      if (stopping) return;
      seen = round;
      const auto* job = work;
      const int total_rows = rows;
      lock.unlock();
      run_band(*job, total_rows, band);
      lock.lock();
      if (--pending == 0) done.notify_one();
    }
  }
};

WorkerPool::WorkerPool(int threads) : state_(std::make_unique<State>()) {
  const int helpers = std::max(0, threads - 1);
  state_->threads.reserve(static_cast<std::size_t>(helpers));
  for (int i = 0; i < helpers; ++i) state_->threads.emplace_back([s = state_.get(), i] { s->serve(i + 1); });
}

WorkerPool::~WorkerPool() {
  {
    std::lock_guard lock(state_->mutex);
    state_->stopping = true;
  }
  state_->start.notify_all();
  for (auto& t : state_->threads) t.join();
}

int WorkerPool::threads() const noexcept { return state_->bands(); }

void WorkerPool::for_rows(int rows, const std::function<void(int, int)>& work) {
  if (state_->threads.empty() || rows < 2 * state_->bands()) {
    if (rows > 0) work(0, rows);
    return;
  }
  {
    std::lock_guard lock(state_->mutex);
    state_->work = &work;
    state_->rows = rows;
    state_->pending = static_cast<int>(state_->threads.size());
    ++state_->round;
  }
  state_->start.notify_all();
  state_->run_band(work, rows, 0);
  std::unique_lock lock(state_->mutex);
  state_->done.wait(lock, [&] { return state_->pending == 0; });
}

}  // namespace smartsurf::surface

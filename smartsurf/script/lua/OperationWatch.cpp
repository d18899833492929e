#include "smartsurf/script/lua/OperationWatch.h"

#include <pthread.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <system_error>
#include <utility>

namespace smartsurf::script {
namespace {

constexpr std::chrono::milliseconds kWatchInterval{100};

}  // namespace

double thread_time_s(clockid_t clock) noexcept {
  struct timespec now {};
  ::clock_gettime(clock, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

OperationWatch::OperationWatch(const std::atomic<bool>* stop, std::function<void(bool)> overrun)
    : stop_(stop), overrun_(std::move(overrun)) {
  try {
    thread_ = std::thread([this] { watch(); });
  } catch (const std::system_error&) {
  }
}

OperationWatch::~OperationWatch() {
  if (!thread_.joinable()) return;
  {
    const std::lock_guard lock(mutex_);
    ends_ = true;
  }
  ended_.notify_one();
  thread_.join();
}

void OperationWatch::begin(double limit_s) noexcept {
  clockid_t clock{};
  if (::pthread_getcpuclockid(::pthread_self(), &clock) != 0) return;
  clock_.store(clock, std::memory_order_relaxed);
  limit_s_.store(limit_s, std::memory_order_relaxed);
  next();
}

void OperationWatch::end() noexcept {
  limit_s_.store(0.0, std::memory_order_relaxed);
  next();
}

void OperationWatch::watch() {
  std::uint64_t watched = 0;
  double began_s = 0.0;  // or was first seen after a stop
  bool stopped = false;
  for (std::unique_lock lock(mutex_); !ended_.wait_for(lock, kWatchInterval, [this] { return ends_; });) {
    const std::uint64_t serial = serial_.load(std::memory_order_acquire);
    const double limit_s = limit_s_.load(std::memory_order_relaxed);
    if (limit_s == 0.0) continue;
    const double now_s = thread_time_s(clock_.load(std::memory_order_relaxed));
    const bool was_stopped =
        std::exchange(stopped, stop_ != nullptr && stop_->load(std::memory_order_relaxed));
    if (std::exchange(watched, serial) != serial || stopped != was_stopped) began_s = now_s;
    if (now_s - began_s > (stopped ? std::min(kTimeAfterStop_s, limit_s) : limit_s)) overrun_(stopped);
  }
}

}  // namespace smartsurf::script

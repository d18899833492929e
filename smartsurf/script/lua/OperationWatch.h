// Watches for operations of a script that Lua cannot interrupt: an access to a table whose keys collide, a
// collection of weak tables, a library function. Internal to this module.
#pragma once

#include <atomic>
#include <condition_variable>
#include <ctime>
#include <functional>
#include <mutex>
#include <thread>

namespace smartsurf::script {

class OperationWatch {
 public:
  // Calls `overrun` on a thread of its own when an operation takes longer than its limit, or half a second
  // after `stop`, which may be null, is raised; again as long as it lasts. Without that thread, if the system
  // refuses it, no operation is watched.
  OperationWatch(const std::atomic<bool>* stop, std::function<void(bool stopped)> overrun);
  ~OperationWatch();
  OperationWatch(const OperationWatch&) = delete;
  OperationWatch& operator=(const OperationWatch&) = delete;

  // Begins an operation that may take `limit_s` of the calling thread's processor time.
  void begin(double limit_s) noexcept;
  // It has ended, and another begins.
  void next() noexcept { serial_.fetch_add(1, std::memory_order_release); }
  void end() noexcept;

 private:
  void watch();

  const std::atomic<bool>* stop_;
  std::function<void(bool)> overrun_;
  std::atomic<std::uint64_t> serial_{0};  // of the operation
  std::atomic<double> limit_s_{0.0};      // 0: in no operation
  std::atomic<clockid_t> clock_{};
  std::mutex mutex_;
  std::condition_variable ended_;
  bool ends_ = false;
  std::thread thread_;
};

// Processor time on a thread's clock.
double thread_time_s(clockid_t clock) noexcept;

constexpr double kTimeAfterStop_s = 0.5;  // for a short callback to end

}  // namespace smartsurf::script

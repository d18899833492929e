// Warns once on standard error when a surface has waited 2 s for the program's next surface.step.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <thread>

namespace apron::run {

// arm() and disarm() may be called on any thread, and cost one reading of the clock.
class StepWatchdog {
 public:
  StepWatchdog();
  ~StepWatchdog();
  StepWatchdog(const StepWatchdog&) = delete;
  StepWatchdog& operator=(const StepWatchdog&) = delete;

  // The surface waits from now on.
  void arm() noexcept;
  void disarm() noexcept { armed_ns_ = 0; }
  bool has_warned() const noexcept { return warned_; }

 private:
  void watch();

  std::atomic<std::int64_t> armed_ns_{0};  // on the steady clock; 0: disarmed
  std::atomic<bool> warned_{false};
  std::mutex mutex_;
  std::condition_variable wake_up_;
  bool quit_ = false;  // guarded by mutex_
  std::thread thread_;
};

}  // namespace apron::run

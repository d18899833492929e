// Named stopwatches (`timer.*`) and interruptible waits.
#pragma once

#include <atomic>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "apron/vm/Host.h"

namespace apron::run {

class Timers {
 public:
  // Monotonic seconds from an arbitrary epoch.
  using Clock = std::function<double()>;

  // Without a clock all timers read 0 and wait() returns at once.
  explicit Timers(Clock clock_s = {}) : clock_s_(std::move(clock_s)) {}

  void start(std::string_view name);           // restarts from 0
  void stop(std::string_view name);            // keeps the elapsed time
  void reset(std::string_view name);           // stops at 0
  double read_s(std::string_view name) const;  // 0 for an unknown timer

  // Returns kInterrupted if stop is raised; the next call then waits for the remaining time only.
  vm::HostStatus wait(double seconds, const std::atomic<bool>& stop);

 private:
  struct Timer {
    std::optional<double> running_since;
    double elapsed_s = 0.0;
  };
  Timer& find_or_create(std::string_view name);
  double now() const { return clock_s_ ? clock_s_() : 0.0; }

  Clock clock_s_;
  std::map<std::string, Timer, std::less<>> timers_;
  std::optional<double> wait_deadline_;
};

// Waits until clock_s() reaches deadline_s. Returns kInterrupted if stop is raised before.
vm::HostStatus wait_until(const Timers::Clock& clock_s, double deadline_s, const std::atomic<bool>& stop);

// The system's steady clock, in seconds.
double wall_clock_s();

}  // namespace apron::run

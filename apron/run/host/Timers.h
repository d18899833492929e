// Named stopwatches (`timer.*`).
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
  // Seconds from any beginning, never falling.
  using Clock = std::function<double()>;

  // Without a clock all timers stand at 0 and wait() comes back at once.
  explicit Timers(Clock clock_s = {}) : clock_s_(std::move(clock_s)) {}

  void start(std::string_view name);  // from 0
  void stop(std::string_view name);   // where it is
  void reset(std::string_view name);  // at 0
  double read_s(std::string_view name) const;

  // Interrupted when the flag is raised; the next call then waits for the rest only.
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

// The machine's clock: wall time.
double wall_clock_s();

}  // namespace apron::run

#include "apron/run/host/FrameClock.h"

#include <algorithm>

namespace apron::run {

vm::HostStatus FrameClock::advance(const std::atomic<bool>& stop) {
  if (rate_.pace) {
    const double wall_period_s = period_s() / *rate_.pace;
    if (!due_s_) due_s_ = clock_s_() + wall_period_s;
    if (wait_until(clock_s_, *due_s_, stop) != vm::HostStatus::kOk) return vm::HostStatus::kInterrupted;
    due_s_ = std::max(*due_s_, clock_s_() - wall_period_s) + wall_period_s;
  }
  ++frame_;
  return vm::HostStatus::kOk;
}

}  // namespace apron::run

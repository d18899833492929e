// Notices that a surface waits for a program that does not reach surface.step.
#pragma once

#include <chrono>

namespace apron::run {

class StepWatchdog {
 public:
  static constexpr const char* kMessage =
      "the surface has waited 2 s for surface.step: is it in every turn of the program's loop?";

  explicit StepWatchdog(bool active) : active_(active) {}

  bool active() const noexcept { return active_; }
  // Call when the program reaches surface.step, and while it is paused.
  void stepped() { last_step_ = Clock::now(); }
  // True once, 2 s after the last call of stepped().
  bool overdue() {
    if (!active_ || Clock::now() - last_step_ < kPatience) return false;
    active_ = false;
    return true;
  }

 private:
  using Clock = std::chrono::steady_clock;
  static constexpr std::chrono::seconds kPatience{2};
  bool active_;
  Clock::time_point last_step_ = Clock::now();
};

}  // namespace apron::run

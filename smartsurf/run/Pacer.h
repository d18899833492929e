// Paces simulated time to a multiple of wall time and measures the real-time factor achieved.
#pragma once

#include <chrono>
#include <optional>

namespace smartsurf::run {

class Pacer {
 public:
  using Clock = std::chrono::steady_clock;

  // Simulated seconds per wall second; nullopt: as fast as possible.
  explicit Pacer(std::optional<double> factor) : factor_(factor) {}

  std::optional<double> factor() const noexcept { return factor_; }
  void set_factor(std::optional<double> factor) noexcept {
    factor_ = factor;
    anchored_ = false;
  }
  // Restarts the schedule, so that a pause is not caught up.
  void restart() noexcept { anchored_ = false; }

  // The time at which the state at that simulated time is due; not later than now if the run is late or
  // unpaced.
  Clock::time_point due_time(double simulated_s) noexcept;
  // Returns the real-time factor over about the last half second.
  double update_real_time_factor(double simulated_s) noexcept;

 private:
  std::optional<double> factor_;
  bool anchored_ = false;
  Clock::time_point anchor_{};
  double anchor_simulated_s_ = 0.0;

  Clock::time_point window_start_{};
  double window_simulated_s_ = 0.0;
  double real_time_factor_ = 0.0;
};

}  // namespace smartsurf::run

// One value per cell that follows its target with a first-order lag and a limited rate of change.
//
//   x ← x + clamp((target − x)·(1 − e^(−dt/lag)), ±max_rate·dt)
//
// Without the limit this is the exact solution of lag·dx/dt = target − x over a step. The exponential alone
// would never arrive: x is set to the target within kArrival of the larger of the target and the value when
// it was set, and where rounding stops it.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "smartsurf/surface/actuators/Actuator.h"

namespace smartsurf::surface {

class RateLimitedLag {
 public:
  static constexpr double kNoRateLimit = 1e30;
  static constexpr float kArrival = 1e-6F;

  // All values and targets start at `start`. max_rate: per second, > 0; lag_s ≥ 0, 0 for no lag.
  RateLimitedLag(const ActuatorContext&, float start, double max_rate, double lag_s);

  // targets: rows × columns; only the model's cells are read.
  void set_targets(std::span<const float> targets) noexcept;
  // Sets all values to their targets.
  void snap_to_targets() noexcept;
  // Advances by one step. The cost is proportional to the runs with cells off their targets.
  void step(double dt_s) noexcept;

  float operator[](int cell) const noexcept { return value_[cell]; }
  std::span<const float> values() const noexcept { return value_; }
  std::span<const CellRun> runs() const noexcept { return runs_; }
  // True if the next step() changes the run's values.
  bool moving(std::size_t run) const noexcept { return moving_[run] != 0; }
  // True if the run's values changed in the last step().
  bool changed(std::size_t run) const noexcept { return changed_[run] != 0; }

  void archive(common::StateArchive& a) { a(value_, target_, arrival_, moving_, changed_); }

 private:
  void step_run(std::size_t run, float lag_fraction, float max_change) noexcept;

  std::vector<CellRun> runs_;
  double max_rate_, lag_s_;
  std::vector<float> value_, target_, arrival_;  // arrival_: the distance from the target that counts as none
  std::vector<std::uint8_t> moving_, changed_;   // one per run
};

}  // namespace smartsurf::surface

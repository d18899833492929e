// Pins: each follows its target height within limits of speed and acceleration, and yields to a load that
// it cannot lift.
#pragma once

#include <cstdint>
#include <optional>

#include "common/threads/ThreadPool.h"
#include "smartsurf/surface/actuators/Actuator.h"

namespace smartsurf::surface {

class MotionProfile;

class Pins final : public Actuator {
 public:
  explicit Pins(const ActuatorContext&);

  void set_targets(int channel, std::span<const float> targets) noexcept override;
  void snap_to_targets(Field&) noexcept override;
  void plan(double dt_s, Field&) noexcept override;
  void commit(double dt_s, Field&) noexcept override;
  bool has_force_limit() const noexcept override { return force_limit_.has_value(); }

 private:
  // Calls work(run) for every run, or for those that move; shared where it is worth it.
  template <class Work>
  void for_each_run(double cost_ns, const Work& work) const;
  template <class Work>
  void for_each_moving_run(double cost_ns, const Work& work) const;
  void plan_run(std::size_t run, const MotionProfile&, float dt_s, Field&) noexcept;
  float plan_under_load(std::size_t cell, const MotionProfile&, float dt_s, Field&) noexcept;
  float lower_stop(std::size_t cell) const { return base_[cell] + min_height_; }

  std::vector<CellRun> runs_;
  common::ThreadPool* pool_;
  std::size_t pin_count_;
  float max_speed_, max_acceleration_;
  float min_height_;  // of the range, over the base
  std::optional<float> force_limit_;
  std::vector<float> base_, target_;  // rows × columns; target: z of the top, base included
  // Of pins with a force limit, rows × columns, empty without: the speed that each was to have, u/s; how long
  // it does not try to leave the lower stop, s.
  std::vector<float> planned_speed_, retry_wait_;
  // One a run, so that a run whose pins all rest on their targets costs nothing.
  std::vector<std::uint8_t> moving_;
  std::vector<float> run_max_height_, run_max_speed_;  // the run's highest top and greatest |speed|
};

}  // namespace smartsurf::surface

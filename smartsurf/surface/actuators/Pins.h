// Pins that follow target heights within limits of speed and acceleration, and yield to loads they cannot
// lift.
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

  void archive(common::StateArchive& a) override {
    a(target_, planned_speed_, retry_wait_, moving_, run_max_height_, run_max_speed_);
  }

 private:
  // Call work(run) for every run, or every moving run, on the pool if that pays. cost_ns: per pin.
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
  float min_height_;  // lower end of the range, u above the base
  std::optional<float> force_limit_;
  std::vector<float> base_, target_;  // rows × columns, u; target_ is the z of the top, base included
  // rows × columns; empty without a force limit. Planned speed before loads, u/s; remaining wait on the lower
  // stop, s.
  std::vector<float> planned_speed_, retry_wait_;
  // One per run, so that runs at rest on their targets cost nothing.
  std::vector<std::uint8_t> moving_;
  std::vector<float> run_max_height_, run_max_speed_;  // maximum height and |speed| of the run
};

}  // namespace smartsurf::surface

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
  std::optional<TipKind> tip() const noexcept override { return tip_; }

  void archive(common::StateArchive& a) override {
    a(target_, planned_speed_, retry_wait_, moving_, group_max_height_, group_max_speed_);
  }

 private:
  // Pins that move together: those of runs_[first_run] to runs_[end_run - 1], and the fixed cells between them.
  struct Group {
    CellRun cells;
    std::size_t first_run, end_run;
  };
  void group_runs(const ActuatorContext&);
  // Call work(group) for every group, or every moving group, on the pool if that pays. cost_ns: per pin.
  template <class Work>
  void for_each_group(double cost_ns, const Work& work) const;
  template <class Work>
  void for_each_moving_group(double cost_ns, const Work& work) const;
  void plan_group(std::size_t group, const MotionProfile&, float dt_s, Field&) noexcept;
  float plan_under_load(std::size_t cell, const MotionProfile&, float dt_s, Field&) noexcept;
  float lower_stop(std::size_t cell) const { return base_[cell] + min_height_; }

  std::vector<CellRun> runs_;
  std::vector<Group> groups_;
  common::ThreadPool* pool_;
  std::size_t pin_count_;
  float max_speed_, max_acceleration_;
  float min_height_;  // lower end of the range, u above the base
  std::optional<float> force_limit_;
  std::optional<TipKind> tip_;
  std::vector<float> base_, target_;  // rows × columns, u; target_ is the z of the top, base included
  // rows × columns; empty without a force limit. Planned speed before loads, u/s; remaining wait on the lower
  // stop, s.
  std::vector<float> planned_speed_, retry_wait_;
  // One per group, so that groups at rest on their targets cost nothing.
  std::vector<std::uint8_t> moving_;
  std::vector<float> group_max_height_, group_max_speed_;  // maximum height and |speed| of the group
};

}  // namespace smartsurf::surface

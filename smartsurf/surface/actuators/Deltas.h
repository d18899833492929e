// Delta robots: tips that move in three directions within a workspace.
#pragma once

#include <Eigen/Core>
#include <array>

#include "smartsurf/scene/Delta.h"
#include "smartsurf/surface/actuators/Actuator.h"

namespace smartsurf::surface {

class MotionProfile;

class Deltas final : public Actuator {
 public:
  explicit Deltas(const ActuatorContext&);

  void set_targets(int channel, std::span<const float> targets) noexcept override;
  void snap_to_targets(Field&) noexcept override;
  void plan(double dt_s, Field&) noexcept override;
  void commit(double dt_s, Field&) noexcept override;
  std::optional<TipKind> tip() const noexcept override;
  void write_cell_motion(std::span<scene::ActuatorState>) const noexcept override;
  bool has_joints() const noexcept override { return true; }
  void write_joint_positions(std::span<float>) const noexcept override;

  void archive(common::StateArchive& a) override {
    a(target_, position_, velocity_, deflection_, moving_, run_max_height_, run_max_speed_);
  }

 private:
  // The target within the workspace: beyond its radius the nearest point.
  Eigen::Vector3f target_of(std::size_t cell) const noexcept;
  // Writes the position of the tip to the field.
  void place(std::size_t cell, Field&) const noexcept;
  // Velocity at which the spring returns an unloaded tip.
  Eigen::Vector3f return_velocity(const Eigen::Vector3f& deflection, float dt_s) const noexcept;
  void plan_run(std::size_t run, const MotionProfile&, float dt_s, Field&) noexcept;

  std::vector<CellRun> runs_;
  scene::Delta delta_;
  bool yields_;
  float max_speed_, max_acceleration_;
  std::vector<float> base_;  // rows × columns, u
  // rows × columns, relative to the middle of the cell's base, u: commands; where the joints hold the tips, and how fast
  // they move; their deflection.
  std::array<std::vector<float>, 3> target_;
  std::vector<Eigen::Vector3f> position_, velocity_, deflection_;
  // One per run, so that runs at rest on their targets cost nothing.
  std::vector<std::uint8_t> moving_;
  std::vector<float> run_max_height_, run_max_speed_;
};

}  // namespace smartsurf::surface

// Cells whose tops drive objects in any horizontal direction: a ball that rolls about two axes, or two
// perpendicular omnidirectional wheels. The surface velocity is a linear map of the two spins.
#pragma once

#include <Eigen/Core>

#include "smartsurf/surface/actuators/Actuator.h"
#include "smartsurf/surface/actuators/RateLimitedLag.h"

namespace smartsurf::surface {

class Rollers final : public Actuator {
 public:
  // drive: surface velocity (u/s) per spin (rad/s) in the cell's own axes; one column per spin.
  Rollers(const ActuatorContext&, const Eigen::Matrix2f& drive);

  void set_targets(int channel, std::span<const float> targets) noexcept override;
  void snap_to_targets(Field&) noexcept override;
  void plan(double dt_s, Field&) noexcept override;
  bool has_surface_velocity() const noexcept override { return true; }
  void write_cell_motion(std::span<scene::ActuatorState>) const noexcept override;

  void archive(common::StateArchive& a) override { a(spin_[0], spin_[1], angle_[0], angle_[1], spinning_); }

 private:
  void update_surface_velocity(const CellRun&, Field&) noexcept;
  bool advance_angles(const CellRun&, float dt_s) noexcept;  // returns whether any cell spins

  Eigen::Matrix2f drive_matrix_;
  RateLimitedLag spin_[2];
  std::vector<float> angle_[2];         // rows × columns, rad
  std::vector<std::uint8_t> spinning_;  // one per run
};

// A ball of radius r: v = ω × r·ẑ at its top.
std::unique_ptr<Actuator> make_ball(const ActuatorContext&);
// Two wheels of radius r: v = r·(spin_a·a + spin_b·b), with a and b their perpendicular drive directions.
std::unique_ptr<Actuator> make_wheels(const ActuatorContext&);

}  // namespace smartsurf::surface

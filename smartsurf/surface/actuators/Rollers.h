// Cells whose tops drive what lies on them in any direction: a ball that rolls about two axes, or two wheels
// with rollers on their rims and with perpendicular axes. The drag is a linear map of the two spins.
#pragma once

#include <Eigen/Core>

#include "smartsurf/surface/actuators/Actuator.h"
#include "smartsurf/surface/actuators/RateLimitedLag.h"

namespace smartsurf::surface {

class Rollers final : public Actuator {
 public:
  // drive: velocity of the top's surface (u/s) per spin (rad/s), in the cell's own axes; one column a spin.
  Rollers(const ActuatorContext&, const Eigen::Matrix2f& drive);

  void set_targets(int channel, std::span<const float> targets) noexcept override;
  void snap_to_targets(Field&) noexcept override;
  void plan(double dt_s, Field&) noexcept override;
  bool has_surface_velocity() const noexcept override { return true; }
  void write_cell_motion(std::span<scene::ActuatorState>) const noexcept override;

 private:
  void update_surface_velocity(const CellRun&, Field&) noexcept;
  bool advance_angles(const CellRun&, float dt_s) noexcept;  // whether any of them spins

  Eigen::Matrix2f drive_matrix_;
  RateLimitedLag spin_[2];
  std::vector<float> angle_[2];         // rows × columns, rad
  std::vector<std::uint8_t> spinning_;  // one a run
};

// v = ω × r·ẑ at the top of a ball of radius r.
std::unique_ptr<Actuator> make_ball(const ActuatorContext&);
// v = r·(spin_a·a + spin_b·b), a and b the perpendicular directions in which the wheels drive.
std::unique_ptr<Actuator> make_wheels(const ActuatorContext&);

}  // namespace smartsurf::surface

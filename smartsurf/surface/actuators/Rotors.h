// Convex shapes that turn about an axle in each cell: the shape's highest point lifts what lies on it, and
// drags it along.
//
// With the rotation R(φ) about the unit axis a, and P(d) the shape's point farthest along d (its support):
// the contact is p = R·P(Rᵀẑ), the top stands at axle + p_z, and its surface moves at φ̇·(a × p).
#pragma once

#include <Eigen/Geometry>

#include "smartsurf/surface/actuators/Actuator.h"
#include "smartsurf/surface/actuators/RateLimitedLag.h"

namespace smartsurf::surface {

class Rotors final : public Actuator {
 public:
  explicit Rotors(const ActuatorContext&);

  void set_targets(int channel, std::span<const float> targets) noexcept override;
  void snap_to_targets(Field&) noexcept override;
  void plan(double dt_s, Field&) noexcept override;
  void commit(double dt_s, Field&) noexcept override;
  bool has_surface_velocity() const noexcept override { return true; }
  void write_cell_motion(std::span<scene::ActuatorState>) const noexcept override;

 private:
  void plan_rates(double dt_s) noexcept;
  void plan_cell(int cell, float dt_s, Field&) noexcept;
  Eigen::Vector3f support_point(float angle) const;

  bool angle_control_;
  Eigen::Vector3f axis_, half_axes_;
  std::vector<Eigen::Vector3f> points_;  // of the shape; empty: an ellipsoid
  float axle_, max_radius_;              // height of the axle; the shape's farthest point from it
  float max_rate_, max_acceleration_;
  RateLimitedLag command_;  // rad or rad/s
  // rows × columns
  std::vector<float> base_, angle_, rate_, next_height_;
  std::vector<std::uint8_t> active_;  // one a run
  float max_base_height_ = 0.0F;
};

}  // namespace smartsurf::surface

// Convex shapes that rotate about an axle in each cell; the highest point lifts and drives the objects on it.
//
// With R(φ) the rotation about the unit axis a and P(d) the shape's support point along d, the contact point
// is p = R·P(Rᵀẑ), the top is at axle + p_z, and its surface velocity is φ̇·(a × p). (Support functions:
// Schneider, Convex Bodies, 2nd ed., 1.7.)
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

  void archive(common::StateArchive& a) override { a(command_, angle_, rate_, next_height_, active_); }

 private:
  void plan_rates(double dt_s) noexcept;
  void plan_cell(int cell, float dt_s, Field&) noexcept;
  Eigen::Vector3f support_point(float angle) const;

  bool angle_control_;
  Eigen::Vector3f axis_, half_axes_;
  std::vector<Eigen::Vector3f> points_;  // vertices of the shape, u; empty for an ellipsoid
  float axle_, max_radius_;              // height of the axle; maximum distance of the shape from it, u
  float max_rate_, max_acceleration_;
  RateLimitedLag command_;  // rad or rad/s
  // rows × columns; u, rad, rad/s, u
  std::vector<float> base_, angle_, rate_, next_height_;
  // One per run: 0 at rest, 1 in the step that returns the velocities to 0, 2 moving.
  std::vector<std::uint8_t> active_;
  float max_base_height_ = 0.0F;
};

}  // namespace smartsurf::surface

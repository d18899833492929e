// Convex shapes that turn about an axle in each cell: the shape's highest point lifts what lies on it, and
// drags it along.
//
// With the rotation R(φ) about the unit axis a, and P(d) the shape's point farthest along d (its support):
// the contact is p = R·P(Rᵀẑ), the top stands at axle + p_z, and its surface moves at φ̇·(a × p).
#pragma once

#include <Eigen/Geometry>

#include "smartsurf/surface/Actuator.h"
#include "smartsurf/surface/Follower.h"

namespace smartsurf::surface {

class Rotors final : public Actuator {
 public:
  explicit Rotors(const Place&);

  void set_targets(int channel, std::span<const float> targets) noexcept override;
  void settle(Field&) noexcept override;
  void plan(double dt_s, Field&) noexcept override;
  void commit(double dt_s, Field&) noexcept override;
  bool drags() const noexcept override { return true; }
  void show(std::span<scene::CellMotion>) const noexcept override;

 private:
  void choose_rates(double dt_s) noexcept;
  void plan_cell(int cell, float dt_s, Field&) noexcept;
  Eigen::Vector3f highest_point(float angle) const;

  bool by_angle_;
  Eigen::Vector3f axis_, half_axes_;
  std::vector<Eigen::Vector3f> points_;  // of the shape; empty: an ellipsoid
  float axle_, greatest_;                // height of the axle; the shape's farthest point from it
  float max_rate_, max_acceleration_;
  Follower command_;  // rad or rad/s
  // rows × columns
  std::vector<float> base_, angle_, rate_, next_height_;
  std::vector<std::uint8_t> turning_;  // one a run
  float highest_base_ = 0.0F;
};

}  // namespace smartsurf::surface

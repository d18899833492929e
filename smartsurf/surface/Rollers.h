// Cells whose tops drive what lies on them in any direction: a ball that rolls about two axes, or two wheels
// with rollers on their rims and with perpendicular axes. The drag is a linear map of the two spins.
#pragma once

#include <Eigen/Core>

#include "smartsurf/surface/Actuator.h"
#include "smartsurf/surface/Follower.h"

namespace smartsurf::surface {

class Rollers final : public Actuator {
 public:
  // drive: velocity of the top's surface (u/s) per spin (rad/s), in the cell's own axes; one column a spin.
  Rollers(const Place&, const Eigen::Matrix2f& drive);

  void set_targets(int channel, std::span<const float> targets) noexcept override;
  void settle(Field&) noexcept override;
  void plan(double dt_s, Field&) noexcept override;
  bool drags() const noexcept override { return true; }
  void show(std::span<scene::CellMotion>) const noexcept override;

 private:
  void drag(const Run&, Field&) noexcept;
  bool turn(const Run&, float dt_s) noexcept;  // whether any of them spins

  Eigen::Matrix2f drive_;
  Follower spin_[2];
  std::vector<float> turned_[2];       // rows × columns, rad
  std::vector<std::uint8_t> turning_;  // one a run
};

// v = ω × r·ẑ at the top of a ball of radius r.
std::unique_ptr<Actuator> make_ball(const Place&);
// v = r·(spin_a·a + spin_b·b), a and b the perpendicular directions in which the wheels drive.
std::unique_ptr<Actuator> make_wheels(const Place&);

}  // namespace smartsurf::surface

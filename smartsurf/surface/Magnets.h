// Electromagnets that attract and repel objects with a pole or a moment, and leave the others alone.
//
// A coil of current I stands `depth` below its cell's top. With r from there to the object and k its
// strength:
//   law dipole   B = k·I·(3(ẑ·r̂)r̂ − ẑ)/r³         law pole   B = k·I·r̂/r²
// A pole q feels q·B, a moment m the force ∇(m·B) and the torque m × B.
#pragma once

#include "smartsurf/surface/Actuator.h"
#include "smartsurf/surface/CellFinder.h"
#include "smartsurf/surface/Follower.h"

namespace smartsurf::surface {

class Magnets final : public Actuator {
 public:
  explicit Magnets(const Place&);

  void set_targets(int channel, std::span<const float> targets) noexcept override;
  void settle(Field&) noexcept override;
  void plan(double dt_s, Field&) noexcept override;
  bool exerts_forces() const noexcept override { return true; }
  void forces(double dt_s, const Field&, const Bodies&, std::span<const scene::ObjectSpec> catalogue,
              std::span<Wrench>) noexcept override;
  void show(std::span<scene::CellMotion>) const noexcept override;

 private:
  void act(float current, const Eigen::Vector3f& from_coil, float pole, const Eigen::Vector3f& moment,
           Wrench&) const noexcept;

  bool single_pole_;
  float strength_, depth_, reach_, most_;
  Follower current_;
  CellFinder cells_;
};

}  // namespace smartsurf::surface

// Electromagnets that act on objects with a magnetic pole or moment.
//
// A coil of current I is centred `depth` below its cell's top. With r the vector from there to the object and
// k the coil's strength:
//   law dipole   B = k·I·(3(ẑ·r̂)r̂ − ẑ)/r³
//   law pole     B = k·I·r̂/r²
// A pole q experiences the force q·B; a moment m the force ∇(m·B) and the torque m × B.
#pragma once

#include "smartsurf/surface/actuators/Actuator.h"
#include "smartsurf/surface/actuators/CellFinder.h"
#include "smartsurf/surface/actuators/RateLimitedLag.h"

namespace smartsurf::surface {

class Magnets final : public Actuator {
 public:
  explicit Magnets(const ActuatorContext&);

  void set_targets(int channel, std::span<const float> targets) noexcept override;
  void snap_to_targets(Field&) noexcept override;
  void plan(double dt_s, Field&) noexcept override;
  bool exerts_forces() const noexcept override { return true; }
  void add_forces(double dt_s, const Field&, const BodyView&, std::span<const scene::ObjectSpec> catalogue,
                  std::span<Wrench>) noexcept override;
  void write_cell_motion(std::span<scene::ActuatorState>) const noexcept override;

  void archive(common::StateArchive& a) override { a(current_); }

 private:
  void add_coil_wrench(float current, const Eigen::Vector3f& from_coil, float pole,
                       const Eigen::Vector3f& moment, Wrench&) const noexcept;

  bool single_pole_;
  float strength_, depth_, reach_, max_current_;
  RateLimitedLag current_;
  CellFinder cells_;
};

}  // namespace smartsurf::surface

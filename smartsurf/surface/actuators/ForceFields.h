// Cells that push what covers them with a force of three components: a programmable force field, whatever
// makes it.
//
// Each covered cell adds F·w(g) at the point of the underside above its centre, g being the gap: so an object
// feels the sum over the area that it covers, and the torque of a field that differs from place to place.
#pragma once

#include "smartsurf/surface/actuators/Actuator.h"
#include "smartsurf/surface/actuators/CellFinder.h"
#include "smartsurf/surface/actuators/RateLimitedLag.h"

namespace smartsurf::surface {

class ForceFields final : public Actuator {
 public:
  explicit ForceFields(const ActuatorContext&);

  void set_targets(int channel, std::span<const float> targets) noexcept override;
  void snap_to_targets(Field&) noexcept override;
  void plan(double dt_s, Field&) noexcept override;
  bool exerts_forces() const noexcept override { return true; }
  void add_forces(double dt_s, const Field&, const BodyView&, std::span<const scene::ObjectSpec> catalogue,
                  std::span<Wrench>) noexcept override;
  void write_cell_motion(std::span<scene::ActuatorState>) const noexcept override;

 private:
  enum class Falloff { kLinear, kFlat, kGaussian };
  float falloff_weight(float gap) const noexcept;

  Falloff falloff_;
  float reach_, max_force_;
  RateLimitedLag force_[3];  // mass·u/s²
  CellFinder cells_;
};

}  // namespace smartsurf::surface

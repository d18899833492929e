// A programmable force field: every cell exerts a three-component force on the objects that cover it.
//
// Each covered cell applies F·w(g) at the point of the underside above its centre, where g is the gap. An
// object receives the sum over its footprint, and a torque if the field is not uniform.
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

  void archive(common::StateArchive& a) override { a(force_[0], force_[1], force_[2]); }

 private:
  enum class Falloff { kLinear, kFlat, kGaussian };
  float falloff_weight(float gap) const noexcept;

  Falloff falloff_;
  float reach_, max_force_;
  RateLimitedLag force_[3];  // mass·u/s²
  CellFinder cells_;
};

}  // namespace smartsurf::surface

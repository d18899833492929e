// Cells that push what covers them with a force of three components: a programmable force field, whatever
// makes it.
//
// Each covered cell adds F·w(g) at the point of the underside above its centre, g being the gap: so an object
// feels the sum over the area that it covers, and the torque of a field that differs from place to place.
#pragma once

#include "smartsurf/surface/Actuator.h"
#include "smartsurf/surface/CellFinder.h"
#include "smartsurf/surface/Follower.h"

namespace smartsurf::surface {

class ForceFields final : public Actuator {
 public:
  explicit ForceFields(const Place&);

  void set_targets(int channel, std::span<const float> targets) noexcept override;
  void settle(Field&) noexcept override;
  void plan(double dt_s, Field&) noexcept override;
  bool exerts_forces() const noexcept override { return true; }
  void forces(double dt_s, const Field&, const Bodies&, std::span<const scene::ObjectSpec> catalogue,
              std::span<Wrench>) noexcept override;
  void show(std::span<scene::CellMotion>) const noexcept override;

 private:
  enum class FallOff { kLinear, kFlat, kGaussian };
  float weight(float gap) const noexcept;

  FallOff fall_off_;
  float reach_, most_;
  Follower force_[3];  // mass·u/s²
  CellFinder cells_;
};

}  // namespace smartsurf::surface

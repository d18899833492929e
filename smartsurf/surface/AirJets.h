// Jets of air that carry and push what covers their nozzles, without touching it.
//
// The air leaves the nozzle at the speed `flow` along the jet's direction and is at the gap g slower by 1/(1
// + g/decay). Each covered cell adds the drag ½·density·drag·area·|u − v|·(u − v), with v the velocity of the
// underside there.
#pragma once

#include <memory>

#include "smartsurf/surface/Actuator.h"
#include "smartsurf/surface/CellFinder.h"
#include "smartsurf/surface/Follower.h"

namespace smartsurf::surface {

class AirJets final : public Actuator {
 public:
  explicit AirJets(const Place&);

  void set_targets(int channel, std::span<const float> targets) noexcept override;
  void settle(Field&) noexcept override;
  void plan(double dt_s, Field&) noexcept override;
  bool exerts_forces() const noexcept override { return true; }
  void forces(double dt_s, const Field&, const Bodies&, std::span<const scene::ObjectSpec> catalogue,
              std::span<Wrench>) noexcept override;
  void show(std::span<scene::CellMotion>) const noexcept override;

 private:
  Eigen::Vector3f jet(int cell, const Field&) const noexcept;  // unit, where the air goes

  float drag_;  // ½·density·drag·area
  float decay_, reach_, lean_, most_;
  Follower flow_, direction_;  // u/s; rad
  CellFinder cells_;
};

}  // namespace smartsurf::surface

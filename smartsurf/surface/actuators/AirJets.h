// Air jets that lift and push the objects covering their nozzles.
//
// Air leaves the nozzle at speed `flow` along the jet direction and decays with the gap g to
// u = flow/(1 + g/decay). Each covered cell adds the drag ½·density·drag·area·|u − v|·(u − v), where v is the
// velocity of the underside at that point.
#pragma once

#include <memory>

#include "smartsurf/surface/actuators/Actuator.h"
#include "smartsurf/surface/actuators/CellFinder.h"
#include "smartsurf/surface/actuators/RateLimitedLag.h"

namespace smartsurf::surface {

class AirJets final : public Actuator {
 public:
  explicit AirJets(const ActuatorContext&);

  void set_targets(int channel, std::span<const float> targets) noexcept override;
  void snap_to_targets(Field&) noexcept override;
  void plan(double dt_s, Field&) noexcept override;
  bool exerts_forces() const noexcept override { return true; }
  void add_forces(double dt_s, const Field&, const BodyView&, std::span<const scene::ObjectSpec> catalogue,
                  std::span<Wrench>) noexcept override;
  void write_cell_motion(std::span<scene::ActuatorState>) const noexcept override;

  void archive(common::StateArchive& a) override { a(flow_, direction_); }

 private:
  Eigen::Vector3f jet_direction(int cell, const Field&) const noexcept;  // unit vector, world frame

  float drag_factor_;  // ½·density·drag·area
  float decay_, reach_, tilt_, max_flow_;
  RateLimitedLag flow_, direction_;  // u/s; rad
  CellFinder cells_;
};

}  // namespace smartsurf::surface

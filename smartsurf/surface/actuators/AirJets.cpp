#include "smartsurf/surface/actuators/AirJets.h"

#include <cmath>

#include "smartsurf/surface/actuators/CoveredCells.h"

namespace smartsurf::surface {

using Eigen::Vector3f;

AirJets::AirJets(const ActuatorContext& context)
    : drag_factor_(static_cast<float>(0.5 * context.spec.number("density") * context.spec.number("drag") *
                                      context.spec.number("area"))),
      decay_(static_cast<float>(context.spec.number("decay"))),
      reach_(static_cast<float>(context.spec.number("reach"))),
      tilt_(static_cast<float>(context.spec.number("lean"))),
      max_flow_(static_cast<float>(context.spec.number("max_flow"))),
      flow_(context, 0.0F, 1e30, context.spec.number("lag")),
      direction_(context, 0.0F, 1e30, context.spec.number("lag")),
      cells_(context) {}

void AirJets::set_targets(int channel, std::span<const float> targets) noexcept {
  (channel == 0 ? flow_ : direction_).set_targets(targets);
}

void AirJets::snap_to_targets(Field&) noexcept {
  flow_.snap_to_targets();
  direction_.snap_to_targets();
}

void AirJets::plan(double dt_s, Field&) noexcept {
  flow_.step(dt_s);
  direction_.step(dt_s);
}

Vector3f AirJets::jet_direction(int cell, const Field& field) const noexcept {
  if (tilt_ == 0.0F) return Vector3f::UnitZ();
  const float azimuth = direction_[cell] + field.angle_of(cell), horizontal = std::sin(tilt_);
  return {horizontal * std::cos(azimuth), horizontal * std::sin(azimuth), std::cos(tilt_)};
}

void AirJets::add_forces(double dt_s, const Field& field, const BodyView& bodies,
                         std::span<const scene::ObjectSpec> catalogue, std::span<Wrench> wrenches) noexcept {
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    if (bodies.mass[b] <= 0.0F) continue;
    const Vector3f &velocity = bodies.velocity[b], &angular_velocity = bodies.angular_velocity[b];
    Wrench sum;
    float drag_slope = 0.0F;  // −∂force/∂velocity
    for_each_covered_cell(cells_, field, bodies, b, catalogue[bodies.id[b]], reach_,
                          [&](int cell, const Vector3f& point, float gap) {
                            if (flow_[cell] == 0.0F) return;
                            const Vector3f air =
                                flow_[cell] / (1.0F + gap / decay_) * jet_direction(cell, field);
                            const Vector3f relative = air - velocity - angular_velocity.cross(point);
                            const float k = drag_factor_ * relative.norm();
                            sum.force += k * relative;
                            sum.torque += point.cross(k * relative);
                            drag_slope += k;
                          });
    // Implicit step: even a light body is never accelerated beyond the speed of the air.
    const float implicit_factor = 1.0F / (1.0F + drag_slope * static_cast<float>(dt_s) / bodies.mass[b]);
    wrenches[b].force += implicit_factor * sum.force;
    wrenches[b].torque += implicit_factor * sum.torque;
  }
}

void AirJets::write_cell_motion(std::span<scene::ActuatorState> motion) const noexcept {
  for (const CellRun& run : flow_.runs())
    for (int i = run.begin; i < run.end; ++i)
      motion[static_cast<std::size_t>(i)] = {direction_[i], 0.0F, flow_[i] / max_flow_};
}

}  // namespace smartsurf::surface

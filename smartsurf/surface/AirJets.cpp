#include "smartsurf/surface/AirJets.h"

#include <cmath>

#include "smartsurf/surface/Covered.h"

namespace smartsurf::surface {

using Eigen::Vector3f;

AirJets::AirJets(const Place& place)
    : drag_(static_cast<float>(0.5 * place.spec.number("density") * place.spec.number("drag") *
                               place.spec.number("area"))),
      decay_(static_cast<float>(place.spec.number("decay"))),
      reach_(static_cast<float>(place.spec.number("reach"))),
      lean_(static_cast<float>(place.spec.number("lean"))),
      most_(static_cast<float>(place.spec.number("max_flow"))),
      flow_(place, 0.0F, 1e30, place.spec.number("lag")),
      direction_(place, 0.0F, 1e30, place.spec.number("lag")),
      cells_(place) {}

void AirJets::set_targets(int channel, std::span<const float> targets) noexcept {
  (channel == 0 ? flow_ : direction_).set_targets(targets);
}

void AirJets::settle(Field&) noexcept {
  flow_.settle();
  direction_.settle();
}

void AirJets::plan(double dt_s, Field&) noexcept {
  flow_.step(dt_s);
  direction_.step(dt_s);
}

Vector3f AirJets::jet(int cell, const Field& field) const noexcept {
  if (lean_ == 0.0F) return Vector3f::UnitZ();
  const float azimuth = direction_[cell] + field.angle_of(cell), across = std::sin(lean_);
  return {across * std::cos(azimuth), across * std::sin(azimuth), std::cos(lean_)};
}

void AirJets::forces(double dt_s, const Field& field, const Bodies& bodies,
                     std::span<const scene::ObjectSpec> catalogue, std::span<Wrench> wrenches) noexcept {
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    if (bodies.mass[b] <= 0.0F) continue;
    const Vector3f &velocity = bodies.velocity[b], &turning = bodies.angular_velocity[b];
    Wrench sum;
    float resistance = 0.0F;  // −∂force/∂velocity
    for_covered(cells_, field, bodies, b, catalogue[bodies.id[b]], reach_,
                [&](int cell, const Vector3f& point, float gap) {
                  if (flow_[cell] == 0.0F) return;
                  const Vector3f air = flow_[cell] / (1.0F + gap / decay_) * jet(cell, field);
                  const Vector3f relative = air - velocity - turning.cross(point);
                  const float k = drag_ * relative.norm();
                  sum.force += k * relative;
                  sum.torque += point.cross(k * relative);
                  resistance += k;
                });
    // The body goes with the air, not past it, however light it is: the step is taken implicitly.
    const float damping = 1.0F / (1.0F + resistance * static_cast<float>(dt_s) / bodies.mass[b]);
    wrenches[b].force += damping * sum.force;
    wrenches[b].torque += damping * sum.torque;
  }
}

void AirJets::show(std::span<scene::CellMotion> motion) const noexcept {
  for (const Run& run : flow_.runs())
    for (int i = run.begin; i < run.end; ++i)
      motion[static_cast<std::size_t>(i)] = {direction_[i], 0.0F, flow_[i] / most_};
}

}  // namespace smartsurf::surface

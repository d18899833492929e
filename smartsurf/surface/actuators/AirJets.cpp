// Air jets that lift and push the objects covering their nozzles.
//
// Air leaves the nozzle at speed `flow` along the jet direction and decays with the gap g to
// u = flow/(1 + g/decay). Each covered cell adds the drag ½·density·drag·area·|u − v|·(u − v), where v is the
// velocity of the underside at that point.
#include <cmath>

#include "smartsurf/surface/actuators/CoveredCells.h"
#include "smartsurf/surface/actuators/Models.h"
#include "smartsurf/surface/actuators/RateLimitedLag.h"

namespace smartsurf::surface {
namespace {

class AirJets final : public Actuator {
  using Vector3f = Eigen::Vector3f;

 public:
  explicit AirJets(const ActuatorContext& context)
      : drag_factor_(static_cast<float>(0.5 * context.spec.number("density") * context.spec.number("drag") *
                                        context.spec.number("area"))),
        decay_(context.number("decay")),
        reach_(context.number("reach")),
        lean_(context.number("lean")),
        max_flow_(context.number("max_flow")),
        flow_(context, 0.0F, RateLimitedLag::kNoRateLimit, context.spec.number("lag")),
        direction_(flow_),
        cells_(context) {}

  void set_targets(int channel, std::span<const float> targets) noexcept override {
    (channel == 0 ? flow_ : direction_).set_targets(targets);
  }

  void snap_to_targets(Field&) noexcept override {
    flow_.snap_to_targets();
    direction_.snap_to_targets();
  }

  void plan(double dt_s, Field&) noexcept override {
    flow_.step(dt_s);
    direction_.step(dt_s);
  }

  bool exerts_forces() const noexcept override { return true; }
  void add_forces(double dt_s, const Field& field, const BodyView& bodies,
                  std::span<const scene::ObjectSpec> catalogue,
                  std::span<Wrench> wrenches) noexcept override {
    for (std::size_t b = 0; b < bodies.size(); ++b) {
      if (bodies.mass[b] <= 0.0F) continue;
      const Vector3f &velocity = bodies.velocity[b], &angular_velocity = bodies.angular_velocity[b];
      Wrench sum;
      float drag_slope = 0.0F;  // −∂force/∂velocity
      const auto add_drag = [&](int cell, const Vector3f& point, float gap) {
        if (flow_[cell] == 0.0F) return;
        const Vector3f air = flow_[cell] / (1.0F + gap / decay_) * jet_direction(cell, field);
        const Vector3f relative = air - velocity - angular_velocity.cross(point);
        const float k = drag_factor_ * relative.norm();
        sum.force += k * relative;
        sum.torque += point.cross(k * relative);
        drag_slope += k;
      };
      for_each_covered_cell(cells_, field, bodies, b, catalogue[bodies.id[b]], reach_, add_drag);
      // Implicit step: even a light body is never accelerated beyond the speed of the air.
      const float implicit_factor = 1.0F / (1.0F + drag_slope * static_cast<float>(dt_s) / bodies.mass[b]);
      wrenches[b].force += implicit_factor * sum.force;
      wrenches[b].torque += implicit_factor * sum.torque;
    }
  }

  void write_cell_motion(std::span<scene::ActuatorState> motion) const noexcept override {
    for (const CellRun& run : flow_.runs())
      for (int i = run.begin; i < run.end; ++i) motion[i] = {direction_[i], 0.0F, flow_[i] / max_flow_};
  }

  void archive(common::StateArchive& a) override { a(flow_, direction_); }

 private:
  // A unit vector in the world frame.
  Vector3f jet_direction(int cell, const Field& field) const noexcept {
    if (lean_ == 0.0F) return Vector3f::UnitZ();
    const float azimuth = direction_[cell] + field.angle_of(cell), horizontal = std::sin(lean_);
    return {horizontal * std::cos(azimuth), horizontal * std::sin(azimuth), std::cos(lean_)};
  }

  float drag_factor_;  // ½·density·drag·area
  float decay_, reach_, lean_, max_flow_;
  RateLimitedLag flow_, direction_;  // u/s; rad
  CellFinder cells_;
};

}  // namespace

std::unique_ptr<Actuator> make_air_jets(const ActuatorContext& context) {
  return std::make_unique<AirJets>(context);
}

}  // namespace smartsurf::surface

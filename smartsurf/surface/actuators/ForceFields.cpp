#include "smartsurf/surface/actuators/ForceFields.h"

#include <cmath>

#include "smartsurf/surface/actuators/CoveredCells.h"

namespace smartsurf::surface {
namespace {

RateLimitedLag make_force_lag(const ActuatorContext& context) {
  return {context, 0.0F, 1e30, context.spec.number("lag")};
}

}  // namespace

ForceFields::ForceFields(const ActuatorContext& context)
    : falloff_(static_cast<Falloff>(static_cast<int>(context.spec.number("fall_off")))),
      reach_(static_cast<float>(context.spec.number("reach"))),
      max_force_(static_cast<float>(context.spec.number("max_force"))),
      force_{make_force_lag(context), make_force_lag(context), make_force_lag(context)},
      cells_(context) {}

void ForceFields::set_targets(int channel, std::span<const float> targets) noexcept {
  force_[channel].set_targets(targets);
}

void ForceFields::snap_to_targets(Field&) noexcept {
  for (RateLimitedLag& f : force_) f.snap_to_targets();
}

void ForceFields::plan(double dt_s, Field&) noexcept {
  for (RateLimitedLag& f : force_) f.step(dt_s);
}

float ForceFields::falloff_weight(float gap) const noexcept {
  const float gap_ratio = gap / reach_;
  switch (falloff_) {
    case Falloff::kLinear:
      return 1.0F - gap_ratio;
    case Falloff::kFlat:
      return 1.0F;
    case Falloff::kGaussian:
      return std::exp(-4.5F * gap_ratio * gap_ratio);  // reach = 3 standard deviations
  }
  return 0.0F;
}

void ForceFields::add_forces(double, const Field& field, const BodyView& bodies,
                             std::span<const scene::ObjectSpec> catalogue,
                             std::span<Wrench> wrenches) noexcept {
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    Wrench& wrench = wrenches[b];
    for_each_covered_cell(cells_, field, bodies, b, catalogue[bodies.id[b]], reach_,
                          [&](int cell, const Eigen::Vector3f& point, float gap) {
                            const Eigen::Vector3f f =
                                falloff_weight(gap) *
                                Eigen::Vector3f(force_[0][cell], force_[1][cell], force_[2][cell]);
                            wrench.force += f;
                            wrench.torque += point.cross(f);
                          });
  }
}

void ForceFields::write_cell_motion(std::span<scene::ActuatorState> motion) const noexcept {
  for (const CellRun& run : force_[0].runs())
    for (int i = run.begin; i < run.end; ++i)
      motion[static_cast<std::size_t>(i)] = {force_[0][i] / max_force_, force_[1][i] / max_force_,
                                             force_[2][i] / max_force_};
}

}  // namespace smartsurf::surface

#include "smartsurf/surface/ForceFields.h"

#include <cmath>

#include "smartsurf/surface/Covered.h"

namespace smartsurf::surface {
namespace {

Follower force(const Place& place) { return {place, 0.0F, 1e30, place.spec.number("lag")}; }

}  // namespace

ForceFields::ForceFields(const Place& place)
    : fall_off_(static_cast<FallOff>(static_cast<int>(place.spec.number("fall_off")))),
      reach_(static_cast<float>(place.spec.number("reach"))),
      most_(static_cast<float>(place.spec.number("max_force"))),
      force_{force(place), force(place), force(place)},
      cells_(place) {}

void ForceFields::set_targets(int channel, std::span<const float> targets) noexcept {
  force_[channel].set_targets(targets);
}

void ForceFields::settle(Field&) noexcept {
  for (Follower& f : force_) f.settle();
}

void ForceFields::plan(double dt_s, Field&) noexcept {
  for (Follower& f : force_) f.step(dt_s);
}

float ForceFields::weight(float gap) const noexcept {
  const float share = gap / reach_;
  switch (fall_off_) {
    case FallOff::kLinear:
      return 1.0F - share;
    case FallOff::kFlat:
      return 1.0F;
    case FallOff::kGaussian:
      return std::exp(-4.5F * share * share);  // the reach is three standard deviations
  }
  return 0.0F;
}

void ForceFields::forces(double, const Field& field, const Bodies& bodies,
                         std::span<const scene::ObjectSpec> catalogue, std::span<Wrench> wrenches) noexcept {
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    Wrench& wrench = wrenches[b];
    for_covered(cells_, field, bodies, b, catalogue[bodies.id[b]], reach_,
                [&](int cell, const Eigen::Vector3f& point, float gap) {
                  const Eigen::Vector3f f =
                      weight(gap) * Eigen::Vector3f(force_[0][cell], force_[1][cell], force_[2][cell]);
                  wrench.force += f;
                  wrench.torque += point.cross(f);
                });
  }
}

void ForceFields::show(std::span<scene::CellMotion> motion) const noexcept {
  for (const Run& run : force_[0].runs())
    for (int i = run.begin; i < run.end; ++i)
      motion[static_cast<std::size_t>(i)] = {force_[0][i] / most_, force_[1][i] / most_,
                                             force_[2][i] / most_};
}

}  // namespace smartsurf::surface

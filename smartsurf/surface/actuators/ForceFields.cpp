// A programmable force field: every cell exerts a three-component force on the objects that cover it.
//
// Each covered cell applies F·w(g) at the point of the underside above its centre, where g is the gap. An
// object receives the sum over its footprint, and a torque if the field is not uniform.
#include <cmath>

#include "smartsurf/surface/actuators/CoveredCells.h"
#include "smartsurf/surface/actuators/Models.h"
#include "smartsurf/surface/actuators/RateLimitedLag.h"

namespace smartsurf::surface {
namespace {

class ForceFields final : public Actuator {
 public:
  explicit ForceFields(const ActuatorContext& context)
      : falloff_(static_cast<Falloff>(static_cast<int>(context.spec.number("fall_off")))),
        reach_(context.number("reach")),
        max_force_(context.number("max_force")),
        force_(3, {context, 0.0F, RateLimitedLag::kNoRateLimit, context.spec.number("lag")}),
        cells_(context) {}

  void set_targets(int channel, std::span<const float> targets) noexcept override {
    force_[channel].set_targets(targets);
  }

  void snap_to_targets(Field&) noexcept override {
    for (RateLimitedLag& f : force_) f.snap_to_targets();
  }

  void plan(double dt_s, Field&) noexcept override {
    for (RateLimitedLag& f : force_) f.step(dt_s);
  }

  bool exerts_forces() const noexcept override { return true; }
  void add_forces(double /*dt_s*/, const Field& field, const BodyView& bodies,
                  std::span<const scene::ObjectSpec> catalogue,
                  std::span<Wrench> wrenches) noexcept override {
    for (std::size_t b = 0; b < bodies.size(); ++b) {
      const auto add_force = [&](int cell, const Eigen::Vector3f& point, float gap) {
        const Eigen::Vector3f f =
            falloff_weight(gap) * Eigen::Vector3f(force_[0][cell], force_[1][cell], force_[2][cell]);
        wrenches[b].force += f;
        wrenches[b].torque += point.cross(f);
      };
      for_each_covered_cell(cells_, field, bodies, b, catalogue[bodies.id[b]], reach_, add_force);
    }
  }

  void write_cell_motion(std::span<scene::ActuatorState> motion) const noexcept override {
    for (const CellRun& run : force_[0].runs())
      for (int i = run.begin; i < run.end; ++i)
        motion[i] = {force_[0][i] / max_force_, force_[1][i] / max_force_, force_[2][i] / max_force_};
  }

  void archive(common::StateArchive& a) override { a(force_[0], force_[1], force_[2]); }

 private:
  enum class Falloff { kLinear, kFlat, kGaussian };
  float falloff_weight(float gap) const noexcept {
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

  Falloff falloff_;
  float reach_, max_force_;
  std::vector<RateLimitedLag> force_;  // x, y and z, mass·u/s²
  CellFinder cells_;
};

}  // namespace

std::unique_ptr<Actuator> make_force_fields(const ActuatorContext& context) {
  return std::make_unique<ForceFields>(context);
}

}  // namespace smartsurf::surface

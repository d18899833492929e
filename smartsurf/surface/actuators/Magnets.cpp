#include "smartsurf/surface/actuators/Magnets.h"

#include <Eigen/Geometry>

namespace smartsurf::surface {
namespace {

using Eigen::Vector3f;

// Objects closer than this to a coil's centre are ignored, u: the field is singular there.
constexpr float kMinDistance = 0.05F;

}  // namespace

Magnets::Magnets(const ActuatorContext& context)
    : single_pole_(context.spec.number("law") == 1.0),
      strength_(static_cast<float>(context.spec.number("strength"))),
      depth_(static_cast<float>(context.spec.number("depth"))),
      reach_(static_cast<float>(context.spec.number("reach"))),
      max_current_(static_cast<float>(context.spec.number("max_current"))),
      current_(context, 0.0F, 1e30, context.spec.number("lag")),
      cells_(context) {}

void Magnets::set_targets(int, std::span<const float> targets) noexcept { current_.set_targets(targets); }
void Magnets::snap_to_targets(Field&) noexcept { current_.snap_to_targets(); }
void Magnets::plan(double dt_s, Field&) noexcept { current_.step(dt_s); }

void Magnets::add_forces(double, const Field& field, const BodyView& bodies,
                         std::span<const scene::ObjectSpec> catalogue, std::span<Wrench> wrenches) noexcept {
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    const scene::ObjectSpec& object = catalogue[bodies.id[b]];
    if (object.magnetic_pole == 0.0 && object.magnetic_moment.isZero(0.0)) continue;
    const Vector3f& centre = bodies.position[b];
    const Vector3f moment = bodies.orientation[b] * object.magnetic_moment.cast<float>();
    if (!centre.allFinite()) continue;
    cells_.for_each_near(centre.x(), centre.y(), reach_, [&](int cell, float x, float y) {
      if (current_[cell] == 0.0F) return;
      const Vector3f coil(x, y, field.height[static_cast<std::size_t>(cell)] - depth_);
      const Vector3f from_coil = centre - coil;
      const float square = from_coil.squaredNorm();
      if (square > reach_ * reach_ || square < kMinDistance * kMinDistance) return;
      add_coil_wrench(current_[cell], from_coil, static_cast<float>(object.magnetic_pole), moment,
                      wrenches[b]);
    });
  }
}

void Magnets::add_coil_wrench(float current, const Vector3f& from_coil, float pole, const Vector3f& m,
                              Wrench& wrench) const noexcept {
  const float r = from_coil.norm(), k = strength_ * current;
  const Vector3f n = from_coil / r, z = Vector3f::UnitZ();
  Vector3f field, gradient;  // B, and ∇(m·B)
  if (single_pole_) {
    field = k / (r * r) * n;
    gradient = k / (r * r * r) * (m - 3.0F * m.dot(n) * n);
  } else {
    const float r3 = r * r * r;
    field = k / r3 * (3.0F * n.z() * n - z);
    gradient = 3.0F * k / (r3 * r) * (n.z() * m + m.dot(n) * z + m.z() * n - 5.0F * n.z() * m.dot(n) * n);
  }
  wrench.force += pole * field + gradient;
  wrench.torque += m.cross(field);
}

void Magnets::write_cell_motion(std::span<scene::ActuatorState> motion) const noexcept {
  for (const CellRun& run : current_.runs())
    for (int i = run.begin; i < run.end; ++i)
      motion[static_cast<std::size_t>(i)].level = current_[i] / max_current_;
}

}  // namespace smartsurf::surface

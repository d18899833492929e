// Electromagnets that act on objects with a magnetic pole or moment.
//
// A coil of current I is centred `depth` below its cell's top. With r the vector from there to the object and
// k the coil's strength:
//   law dipole   B = k·I·(3(ẑ·r̂)r̂ − ẑ)/r³
//   law pole     B = k·I·r̂/r²
// A pole q experiences the force q·B; a moment m the force ∇(m·B) and the torque m × B.
#include <Eigen/Geometry>

#include "smartsurf/surface/actuators/CellFinder.h"
#include "smartsurf/surface/actuators/Models.h"
#include "smartsurf/surface/actuators/RateLimitedLag.h"

namespace smartsurf::surface {
namespace {

// Objects closer than this to a coil's centre are ignored, pitches: the field is singular there.
constexpr float kMinDistance = 0.05F;

class Magnets final : public Actuator {
  using Vector3f = Eigen::Vector3f;

 public:
  explicit Magnets(const ActuatorContext& context)
      : single_pole_(context.spec.number("law") == 1.0),
        strength_(context.number("strength")),
        depth_(context.number("depth")),
        reach_(context.number("reach")),
        min_distance_(kMinDistance * context.field.pitch),
        max_current_(context.number("max_current")),
        current_(context, 0.0F, RateLimitedLag::kNoRateLimit, context.spec.number("lag")),
        cells_(context) {}

  void set_targets(int, std::span<const float> targets) noexcept override { current_.set_targets(targets); }
  void snap_to_targets(Field&) noexcept override { current_.snap_to_targets(); }
  void plan(double dt_s, Field&) noexcept override { current_.step(dt_s); }

  bool exerts_forces() const noexcept override { return true; }
  void add_forces(double /*dt_s*/, const Field& field, const BodyView& bodies,
                  std::span<const scene::ObjectSpec> catalogue,
                  std::span<Wrench> wrenches) noexcept override {
    for (std::size_t b = 0; b < bodies.size(); ++b) {
      const scene::ObjectSpec& object = catalogue[bodies.id[b]];
      if (object.magnetic_pole == 0.0 && object.magnetic_moment.isZero(0.0)) continue;
      const Vector3f& centre = bodies.position[b];
      const Vector3f moment = bodies.orientation[b] * object.magnetic_moment.cast<float>();
      if (!centre.allFinite()) continue;
      cells_.for_each_near(centre.x(), centre.y(), reach_, [&](int cell, float x, float y) {
        if (current_[cell] == 0.0F) return;
        const Vector3f from_coil = centre - Vector3f(x, y, field.height[cell] - depth_);
        const float square = from_coil.squaredNorm();
        if (square > reach_ * reach_ || square < min_distance_ * min_distance_) return;
        add_coil_wrench(current_[cell], from_coil, static_cast<float>(object.magnetic_pole), moment,
                        wrenches[b]);
      });
    }
  }

  void write_cell_motion(std::span<scene::ActuatorState> motion) const noexcept override {
    for (const CellRun& run : current_.runs())
      for (int i = run.begin; i < run.end; ++i) motion[i].level = current_[i] / max_current_;
  }

  void archive(common::StateArchive& a) override { a(current_); }

 private:
  void add_coil_wrench(float current, const Vector3f& from_coil, float pole, const Vector3f& m,
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

  bool single_pole_;
  float strength_, depth_, reach_, min_distance_, max_current_;
  RateLimitedLag current_;
  CellFinder cells_;
};

}  // namespace

std::unique_ptr<Actuator> make_magnets(const ActuatorContext& context) {
  return std::make_unique<Magnets>(context);
}

}  // namespace smartsurf::surface

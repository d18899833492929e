// Cells whose tops drive objects in any horizontal direction: a ball that rolls about two axes, or two
// perpendicular omnidirectional wheels. The surface velocity is a linear map of the two spins.
#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "smartsurf/surface/actuators/Models.h"
#include "smartsurf/surface/actuators/RateLimitedLag.h"

namespace smartsurf::surface {
namespace {

class Rollers final : public Actuator {
 public:
  // drive: surface velocity (u/s) per spin (rad/s) in the cell's own axes; one column per spin.
  Rollers(const ActuatorContext& context, const Eigen::Matrix2f& drive)
      : drive_matrix_(drive),
        spin_(2, {context, 0.0F, context.spec.number("max_acceleration"), context.spec.number("lag")}),
        angle_(2, std::vector<float>(context.field.height.size(), 0.0F)),
        steady_s_(context.runs.size(), 0.0) {}

  void set_targets(int channel, std::span<const float> targets) noexcept override {
    spin_[channel].set_targets(targets);
  }

  void snap_to_targets(Field& field) noexcept override {
    for (RateLimitedLag& s : spin_) s.snap_to_targets();
    for (const CellRun& run : spin_[0].runs()) update_surface_velocity(run, field);
  }

  void plan(double dt_s, Field& field) noexcept override {
    for (std::size_t r = 0; r < steady_s_.size(); ++r)
      if (spin_[0].moving(r) || spin_[1].moving(r)) advance_angles(r);
    for (RateLimitedLag& s : spin_) s.step(dt_s);
    for (std::size_t r = 0; r < steady_s_.size(); ++r) {
      if (spin_[0].changed(r) || spin_[1].changed(r)) update_surface_velocity(spin_[0].runs()[r], field);
      steady_s_[r] += dt_s;
    }
  }

  bool has_surface_velocity() const noexcept override { return true; }

  void write_cell_motion(std::span<scene::ActuatorState> motion) const noexcept override {
    for (std::size_t r = 0; r < steady_s_.size(); ++r) {
      const CellRun& run = spin_[0].runs()[r];
      for (int i = run.begin; i < run.end; ++i) motion[i].a = angle(0, i, r), motion[i].b = angle(1, i, r);
    }
  }

  void archive(common::StateArchive& a) override { a(spin_[0], spin_[1], angle_[0], angle_[1], steady_s_); }

 private:
  void update_surface_velocity(const CellRun& run, Field& field) noexcept {
    for (int i = run.begin; i < run.end; ++i) {
      Eigen::Vector2f v = drive_matrix_ * Eigen::Vector2f(spin_[0][i], spin_[1][i]);
      if (!field.is_rectangular()) v = Eigen::Rotation2Df(field.angle_of(i)) * v;
      field.surface_velocity_x[i] = v.x();
      field.surface_velocity_y[i] = v.y();
    }
  }

  // Phase of cell i in a run, from −π to π, rad.
  float angle(int k, int i, std::size_t run) const noexcept {
    constexpr double kTwoPi = 2.0 * std::numbers::pi;
    const double angle = angle_[k][i] + steady_s_[run] * spin_[k][i];
    return static_cast<float>(angle - kTwoPi * std::nearbyint(angle / kTwoPi));
  }

  void advance_angles(std::size_t run) noexcept {
    const CellRun& cells = spin_[0].runs()[run];
    for (int k = 0; k < 2; ++k)
      for (int i = cells.begin; i < cells.end; ++i) angle_[k][i] = angle(k, i, run);
    steady_s_[run] = 0.0;
  }

  Eigen::Matrix2f drive_matrix_;
  std::vector<RateLimitedLag> spin_;       // two
  std::vector<std::vector<float>> angle_;  // of both when the run's spins last changed; rows × columns, rad
  std::vector<double> steady_s_;           // for how long they have not changed since; one per run
};

}  // namespace

// A ball of radius r: v = ω × r·ẑ at its top.
std::unique_ptr<Actuator> make_ball(const ActuatorContext& context) {
  const float r = context.number("radius");
  Eigen::Matrix2f drive;
  drive << 0.0F, r, -r, 0.0F;
  return std::make_unique<Rollers>(context, drive);
}

// Two wheels of radius r: v = r·(spin_a·a + spin_b·b), with a and b their perpendicular drive directions.
std::unique_ptr<Actuator> make_wheels(const ActuatorContext& context) {
  const Eigen::Rotation2Df direction(context.number("angle"));
  return std::make_unique<Rollers>(context, context.number("radius") * direction.toRotationMatrix());
}

}  // namespace smartsurf::surface

#include "smartsurf/surface/actuators/Rollers.h"

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

namespace smartsurf::surface {
namespace {

RateLimitedLag make_spin_lag(const ActuatorContext& context) {
  return {context, 0.0F, context.spec.number("max_acceleration"), context.spec.number("lag")};
}

}  // namespace

Rollers::Rollers(const ActuatorContext& context, const Eigen::Matrix2f& drive)
    : drive_matrix_(drive),
      spin_{make_spin_lag(context), make_spin_lag(context)},
      angle_{std::vector<float>(context.field.height.size(), 0.0F),
             std::vector<float>(context.field.height.size(), 0.0F)},
      spinning_(context.runs.size(), 0) {}

void Rollers::set_targets(int channel, std::span<const float> targets) noexcept {
  spin_[channel].set_targets(targets);
}

void Rollers::snap_to_targets(Field& field) noexcept {
  for (RateLimitedLag& s : spin_) s.snap_to_targets();
  for (std::size_t r = 0; r < spinning_.size(); ++r) {
    spinning_[r] = 1;
    update_surface_velocity(spin_[0].runs()[r], field);
  }
}

void Rollers::plan(double dt_s, Field& field) noexcept {
  for (RateLimitedLag& s : spin_) s.step(dt_s);
  for (std::size_t r = 0; r < spinning_.size(); ++r) {
    const CellRun& run = spin_[0].runs()[r];
    if (spin_[0].changed(r) || spin_[1].changed(r)) {
      update_surface_velocity(run, field);
      spinning_[r] = 1;
    }
    if (!spinning_[r]) continue;
    spinning_[r] = advance_angles(run, static_cast<float>(dt_s));
  }
}

void Rollers::update_surface_velocity(const CellRun& run, Field& field) noexcept {
  for (int i = run.begin; i < run.end; ++i) {
    Eigen::Vector2f v = drive_matrix_ * Eigen::Vector2f(spin_[0][i], spin_[1][i]);
    if (!field.is_rectangular()) v = Eigen::Rotation2Df(field.angle_of(i)) * v;
    field.surface_velocity_x[static_cast<std::size_t>(i)] = v.x();
    field.surface_velocity_y[static_cast<std::size_t>(i)] = v.y();
  }
}

bool Rollers::advance_angles(const CellRun& run, float dt_s) noexcept {
  constexpr auto kTwoPi = static_cast<float>(2.0 * std::numbers::pi);
  bool spinning = false;
  for (int k = 0; k < 2; ++k)
    for (int i = run.begin; i < run.end; ++i) {
      float& angle = angle_[k][static_cast<std::size_t>(i)];
      angle = std::remainder(angle + spin_[k][i] * dt_s, kTwoPi);
      spinning |= spin_[k][i] != 0.0F;
    }
  return spinning;
}

void Rollers::write_cell_motion(std::span<scene::ActuatorState> motion) const noexcept {
  for (const CellRun& run : spin_[0].runs())
    for (auto i = static_cast<std::size_t>(run.begin); i < static_cast<std::size_t>(run.end); ++i) {
      motion[i].a = angle_[0][i];
      motion[i].b = angle_[1][i];
    }
}

std::unique_ptr<Actuator> make_ball(const ActuatorContext& context) {
  const auto r = static_cast<float>(context.spec.number("radius"));
  Eigen::Matrix2f drive;
  drive << 0.0F, r, -r, 0.0F;
  return std::make_unique<Rollers>(context, drive);
}

std::unique_ptr<Actuator> make_wheels(const ActuatorContext& context) {
  const auto r = static_cast<float>(context.spec.number("radius"));
  const auto angle = static_cast<float>(context.spec.number("angle"));
  return std::make_unique<Rollers>(context, r * Eigen::Rotation2Df(angle).toRotationMatrix());
}

}  // namespace smartsurf::surface

#include "smartsurf/surface/Rollers.h"

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

namespace smartsurf::surface {
namespace {

Follower spin(const Place& place) {
  return {place, 0.0F, place.spec.number("max_acceleration"), place.spec.number("lag")};
}

}  // namespace

Rollers::Rollers(const Place& place, const Eigen::Matrix2f& drive)
    : drive_(drive),
      spin_{spin(place), spin(place)},
      turned_{std::vector<float>(place.field.height.size(), 0.0F),
              std::vector<float>(place.field.height.size(), 0.0F)},
      turning_(place.runs.size(), 0) {}

void Rollers::set_targets(int channel, std::span<const float> targets) noexcept {
  spin_[channel].set_targets(targets);
}

void Rollers::settle(Field& field) noexcept {
  for (Follower& s : spin_) s.settle();
  for (std::size_t r = 0; r < turning_.size(); ++r) {
    turning_[r] = 1;
    drag(spin_[0].runs()[r], field);
  }
}

void Rollers::plan(double dt_s, Field& field) noexcept {
  for (Follower& s : spin_) s.step(dt_s);
  for (std::size_t r = 0; r < turning_.size(); ++r) {
    const Run& run = spin_[0].runs()[r];
    if (spin_[0].changed(r) || spin_[1].changed(r)) {
      drag(run, field);
      turning_[r] = 1;
    }
    if (!turning_[r]) continue;
    turning_[r] = turn(run, static_cast<float>(dt_s));
  }
}

void Rollers::drag(const Run& run, Field& field) noexcept {
  for (int i = run.begin; i < run.end; ++i) {
    Eigen::Vector2f v = drive_ * Eigen::Vector2f(spin_[0][i], spin_[1][i]);
    if (!field.rectangular()) v = Eigen::Rotation2Df(field.angle_of(i)) * v;
    field.drag_x[static_cast<std::size_t>(i)] = v.x();
    field.drag_y[static_cast<std::size_t>(i)] = v.y();
  }
}

bool Rollers::turn(const Run& run, float dt_s) noexcept {
  constexpr auto kTurn = static_cast<float>(2.0 * std::numbers::pi);
  bool turns = false;
  for (int k = 0; k < 2; ++k)
    for (int i = run.begin; i < run.end; ++i) {
      float& angle = turned_[k][static_cast<std::size_t>(i)];
      angle = std::remainder(angle + spin_[k][i] * dt_s, kTurn);
      turns |= spin_[k][i] != 0.0F;
    }
  return turns;
}

void Rollers::show(std::span<scene::CellMotion> motion) const noexcept {
  for (const Run& run : spin_[0].runs())
    for (auto i = static_cast<std::size_t>(run.begin); i < static_cast<std::size_t>(run.end); ++i) {
      motion[i].a = turned_[0][i];
      motion[i].b = turned_[1][i];
    }
}

std::unique_ptr<Actuator> make_ball(const Place& place) {
  const auto r = static_cast<float>(place.spec.number("radius"));
  Eigen::Matrix2f drive;
  drive << 0.0F, r, -r, 0.0F;
  return std::make_unique<Rollers>(place, drive);
}

std::unique_ptr<Actuator> make_wheels(const Place& place) {
  const auto r = static_cast<float>(place.spec.number("radius"));
  const auto angle = static_cast<float>(place.spec.number("angle"));
  return std::make_unique<Rollers>(place, r * Eigen::Rotation2Df(angle).toRotationMatrix());
}

}  // namespace smartsurf::surface

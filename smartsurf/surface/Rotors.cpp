#include "smartsurf/surface/Rotors.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "smartsurf/surface/Approach.h"

namespace smartsurf::surface {
namespace {

Eigen::Vector3f vector_of(const std::vector<double>& v, std::size_t first = 0) {
  return Eigen::Vector3d(v[first], v[first + 1], v[first + 2]).cast<float>();
}

}  // namespace

Rotors::Rotors(const Place& place)
    : by_angle_(place.spec.number("command") == 1.0),
      axis_(vector_of(place.spec.numbers("axis")).normalized()),
      half_axes_(vector_of(place.spec.numbers("half_axes"))),
      axle_(static_cast<float>(place.spec.number("axle"))),
      greatest_(half_axes_.maxCoeff()),
      max_rate_(static_cast<float>(place.spec.number("max_rate"))),
      max_acceleration_(static_cast<float>(place.spec.number("max_acceleration"))),
      // The angle's own speed and acceleration are limited below: what is commanded passes the lag only.
      command_(place, 0.0F, by_angle_ ? 1e30 : place.spec.number("max_acceleration"),
               place.spec.number("lag")),
      base_(place.field.height),
      angle_(base_.size(), 0.0F),
      rate_(base_.size(), 0.0F),
      next_height_(base_.size(), 0.0F),
      turning_(place.runs.size(), 0) {
  if (place.spec.has("points")) {
    const std::vector<double>& flat = place.spec.numbers("points");
    greatest_ = 0.0F;
    for (std::size_t i = 0; i + 2 < flat.size(); i += 3) {
      points_.push_back(vector_of(flat, i));
      greatest_ = std::max(greatest_, points_.back().norm());
    }
  }
  for (const Run& run : place.runs)
    for (int i = run.begin; i < run.end; ++i)
      highest_base_ = std::max(highest_base_, base_[static_cast<std::size_t>(i)]);
}

Eigen::Vector3f Rotors::highest_point(float angle) const {
  const Eigen::Matrix3f turn = Eigen::AngleAxisf(angle, axis_).toRotationMatrix();
  const Eigen::Vector3f up = turn.row(2).transpose();  // ẑ as the shape sees it
  if (points_.empty()) {
    const Eigen::Vector3f scaled = half_axes_.cwiseProduct(up);
    return turn * half_axes_.cwiseProduct(scaled) / scaled.norm();
  }
  const Eigen::Vector3f* best = &points_.front();
  for (const Eigen::Vector3f& p : points_)
    if (p.dot(up) > best->dot(up)) best = &p;
  return turn * *best;
}

void Rotors::set_targets(int, std::span<const float> targets) noexcept { command_.set_targets(targets); }

void Rotors::settle(Field& field) noexcept {
  command_.settle();
  for (std::size_t r = 0; r < turning_.size(); ++r) {
    turning_[r] = 1;
    for (int cell = command_.runs()[r].begin; cell < command_.runs()[r].end; ++cell) {
      const auto i = static_cast<std::size_t>(cell);
      (by_angle_ ? angle_ : rate_)[i] = command_[cell];
      field.height[i] = next_height_[i] = base_[i] + axle_ + highest_point(angle_[i]).z();
    }
  }
}

void Rotors::choose_rates(double dt_s) noexcept {
  const Approach approach(max_rate_, max_acceleration_, static_cast<float>(dt_s));
  command_.step(dt_s);
  for (std::size_t r = 0; r < turning_.size(); ++r) {
    turning_[r] |= static_cast<std::uint8_t>(command_.changed(r));
    if (!turning_[r]) continue;
    bool turns = false;
    for (int cell = command_.runs()[r].begin; cell < command_.runs()[r].end; ++cell) {
      const auto i = static_cast<std::size_t>(cell);
      rate_[i] = by_angle_ ? approach(command_[cell] - angle_[i], rate_[i]) : command_[cell];
      turns |= rate_[i] != 0.0F || (by_angle_ && command_[cell] != angle_[i]);
    }
    turning_[r] = turns ? 2 : 1;  // 1: their last step, in which speed and drag go to 0
  }
}

void Rotors::plan(double dt_s, Field& field) noexcept {
  choose_rates(dt_s);
  for (std::size_t r = 0; r < turning_.size(); ++r)
    if (turning_[r])
      for (int cell = command_.runs()[r].begin; cell < command_.runs()[r].end; ++cell)
        plan_cell(cell, static_cast<float>(dt_s), field);
  field.max_height = std::max(field.max_height, highest_base_ + axle_ + greatest_);
}

// The speed is that of the whole step, so that the top is where the shape is at its end.
void Rotors::plan_cell(int cell, float dt_s, Field& field) noexcept {
  const auto i = static_cast<std::size_t>(cell);
  constexpr auto kTurn = static_cast<float>(2.0 * std::numbers::pi);
  angle_[i] = by_angle_ ? Approach::arrive(angle_[i], rate_[i], command_[cell], dt_s)
                        : std::remainder(angle_[i] + rate_[i] * dt_s, kTurn);
  const Eigen::Vector3f p = highest_point(angle_[i]);
  next_height_[i] = base_[i] + axle_ + p.z();
  field.speed[i] = (next_height_[i] - field.height[i]) / dt_s;
  field.max_speed = std::max(field.max_speed, std::abs(field.speed[i]));
  const Eigen::AngleAxisf stands(field.angle_of(cell), Eigen::Vector3f::UnitZ());
  const Eigen::Vector3f drag = rate_[i] * (stands * axis_.cross(p));
  field.drag_x[i] = drag.x();
  field.drag_y[i] = drag.y();
  field.spin[i] = rate_[i] * axis_.z();
}

void Rotors::commit(double, Field& field) noexcept {
  for (std::size_t r = 0; r < turning_.size(); ++r) {
    if (!turning_[r]) continue;
    for (auto i = static_cast<std::size_t>(command_.runs()[r].begin);
         i < static_cast<std::size_t>(command_.runs()[r].end); ++i)
      field.height[i] = next_height_[i];
    turning_[r] = turning_[r] == 2;
  }
}

void Rotors::show(std::span<scene::CellMotion> motion) const noexcept {
  for (const Run& run : command_.runs())
    for (auto i = static_cast<std::size_t>(run.begin); i < static_cast<std::size_t>(run.end); ++i)
      motion[i].a = angle_[i];
}

}  // namespace smartsurf::surface

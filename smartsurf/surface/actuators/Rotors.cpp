#include "smartsurf/surface/actuators/Rotors.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "smartsurf/surface/actuators/MotionProfile.h"

namespace smartsurf::surface {
namespace {

Eigen::Vector3f vector_of(const std::vector<double>& v, std::size_t first = 0) {
  return Eigen::Vector3d(v[first], v[first + 1], v[first + 2]).cast<float>();
}

}  // namespace

Rotors::Rotors(const ActuatorContext& context)
    : angle_control_(context.spec.number("command") == 1.0),
      axis_(vector_of(context.spec.numbers("axis")).normalized()),
      half_axes_(vector_of(context.spec.numbers("half_axes"))),
      axle_(static_cast<float>(context.spec.number("axle"))),
      max_radius_(half_axes_.maxCoeff()),
      max_rate_(static_cast<float>(context.spec.number("max_rate"))),
      max_acceleration_(static_cast<float>(context.spec.number("max_acceleration"))),
      // plan_rates() limits the rate and acceleration of a commanded angle, so the command has a lag only.
      command_(context, 0.0F, angle_control_ ? 1e30 : context.spec.number("max_acceleration"),
               context.spec.number("lag")),
      base_(context.field.height),
      angle_(base_.size(), 0.0F),
      rate_(base_.size(), 0.0F),
      next_height_(base_.size(), 0.0F),
      active_(context.runs.size(), 0) {
  if (context.spec.has("points")) {
    const std::vector<double>& flat = context.spec.numbers("points");
    max_radius_ = 0.0F;
    for (std::size_t i = 0; i + 2 < flat.size(); i += 3) {
      points_.push_back(vector_of(flat, i));
      max_radius_ = std::max(max_radius_, points_.back().norm());
    }
  }
  for (const CellRun& run : context.runs)
    for (int i = run.begin; i < run.end; ++i)
      max_base_height_ = std::max(max_base_height_, base_[static_cast<std::size_t>(i)]);
}

Eigen::Vector3f Rotors::support_point(float angle) const {
  const Eigen::Matrix3f rotation = Eigen::AngleAxisf(angle, axis_).toRotationMatrix();
  const Eigen::Vector3f up = rotation.row(2).transpose();  // ẑ in the shape's frame
  if (points_.empty()) {
    const Eigen::Vector3f scaled = half_axes_.cwiseProduct(up);
    return rotation * half_axes_.cwiseProduct(scaled) / scaled.norm();
  }
  const Eigen::Vector3f* best = &points_.front();
  for (const Eigen::Vector3f& p : points_)
    if (p.dot(up) > best->dot(up)) best = &p;
  return rotation * *best;
}

void Rotors::set_targets(int, std::span<const float> targets) noexcept { command_.set_targets(targets); }

void Rotors::snap_to_targets(Field& field) noexcept {
  command_.snap_to_targets();
  for (std::size_t r = 0; r < active_.size(); ++r) {
    active_[r] = 1;
    for (int cell = command_.runs()[r].begin; cell < command_.runs()[r].end; ++cell) {
      const auto i = static_cast<std::size_t>(cell);
      (angle_control_ ? angle_ : rate_)[i] = command_[cell];
      field.height[i] = next_height_[i] = base_[i] + axle_ + support_point(angle_[i]).z();
    }
  }
}

void Rotors::plan_rates(double dt_s) noexcept {
  const MotionProfile profile(max_rate_, max_acceleration_, static_cast<float>(dt_s));
  command_.step(dt_s);
  for (std::size_t r = 0; r < active_.size(); ++r) {
    active_[r] |= static_cast<std::uint8_t>(command_.changed(r));
    if (!active_[r]) continue;
    bool moving = false;
    for (int cell = command_.runs()[r].begin; cell < command_.runs()[r].end; ++cell) {
      const auto i = static_cast<std::size_t>(cell);
      rate_[i] = angle_control_ ? profile(command_[cell] - angle_[i], rate_[i]) : command_[cell];
      moving |= rate_[i] != 0.0F || (angle_control_ && command_[cell] != angle_[i]);
    }
    active_[r] = moving ? 2 : 1;  // 1: one more step sets the velocities to 0
  }
}

void Rotors::plan(double dt_s, Field& field) noexcept {
  plan_rates(dt_s);
  for (std::size_t r = 0; r < active_.size(); ++r)
    if (active_[r])
      for (int cell = command_.runs()[r].begin; cell < command_.runs()[r].end; ++cell)
        plan_cell(cell, static_cast<float>(dt_s), field);
  field.max_height = std::max(field.max_height, max_base_height_ + axle_ + max_radius_);
}

// `speed` is the mean over the step, so that the top meets the shape's support point at the end of the step.
void Rotors::plan_cell(int cell, float dt_s, Field& field) noexcept {
  const auto i = static_cast<std::size_t>(cell);
  constexpr auto kTwoPi = static_cast<float>(2.0 * std::numbers::pi);
  angle_[i] = angle_control_ ? MotionProfile::advance(angle_[i], rate_[i], command_[cell], dt_s)
                             : std::remainder(angle_[i] + rate_[i] * dt_s, kTwoPi);
  const Eigen::Vector3f p = support_point(angle_[i]);
  next_height_[i] = base_[i] + axle_ + p.z();
  field.speed[i] = (next_height_[i] - field.height[i]) / dt_s;
  field.max_speed = std::max(field.max_speed, std::abs(field.speed[i]));
  const Eigen::AngleAxisf cell_rotation(field.angle_of(cell), Eigen::Vector3f::UnitZ());
  const Eigen::Vector3f surface_velocity = rate_[i] * (cell_rotation * axis_.cross(p));
  field.surface_velocity_x[i] = surface_velocity.x();
  field.surface_velocity_y[i] = surface_velocity.y();
  field.surface_spin[i] = rate_[i] * axis_.z();
}

void Rotors::commit(double, Field& field) noexcept {
  for (std::size_t r = 0; r < active_.size(); ++r) {
    if (!active_[r]) continue;
    for (auto i = static_cast<std::size_t>(command_.runs()[r].begin);
         i < static_cast<std::size_t>(command_.runs()[r].end); ++i)
      field.height[i] = next_height_[i];
    active_[r] = active_[r] == 2;
  }
}

void Rotors::write_cell_motion(std::span<scene::ActuatorState> motion) const noexcept {
  for (const CellRun& run : command_.runs())
    for (auto i = static_cast<std::size_t>(run.begin); i < static_cast<std::size_t>(run.end); ++i)
      motion[i].a = angle_[i];
}

}  // namespace smartsurf::surface

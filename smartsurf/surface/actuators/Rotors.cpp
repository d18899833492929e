// Convex shapes that rotate about an axle in each cell; the highest point lifts and drives the objects on it.
//
// With R(φ) the rotation about the unit axis a and P(d) the shape's support point along d, the contact point
// is p = R·P(Rᵀẑ), the top is at axle + p_z, and its surface velocity is φ̇·(a × p). (Support functions:
// Schneider, Convex Bodies, 2nd ed., 1.7.)
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "smartsurf/surface/actuators/Models.h"
#include "smartsurf/surface/actuators/MotionProfile.h"
#include "smartsurf/surface/actuators/RateLimitedLag.h"

namespace smartsurf::surface {
namespace {

Eigen::Vector3f vector_of(const std::vector<double>& v, std::size_t first = 0) {
  return Eigen::Vector3d(v[first], v[first + 1], v[first + 2]).cast<float>();
}

class Rotors final : public Actuator {
 public:
  explicit Rotors(const ActuatorContext& context)
      : angle_control_(context.spec.number("command") == 1.0),
        axis_(vector_of(context.spec.numbers("axis")).normalized()),
        half_axes_(vector_of(context.spec.numbers("half_axes"))),
        axle_(context.number("axle")),
        max_radius_(half_axes_.maxCoeff()),
        max_rate_(context.number("max_rate")),
        max_acceleration_(context.number("max_acceleration")),
        // plan_rates() limits the rate and acceleration of a commanded angle, so the command has a lag only.
        command_(context, 0.0F,
                 angle_control_ ? RateLimitedLag::kNoRateLimit : context.spec.number("max_acceleration"),
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
      for (int i = run.begin; i < run.end; ++i) max_base_height_ = std::max(max_base_height_, base_[i]);
  }

  void set_targets(int, std::span<const float> targets) noexcept override { command_.set_targets(targets); }

  void snap_to_targets(Field& field) noexcept override {
    command_.snap_to_targets();
    for (std::size_t r = 0; r < active_.size(); ++r) {
      active_[r] = 1;
      for (int i = command_.runs()[r].begin; i < command_.runs()[r].end; ++i) {
        (angle_control_ ? angle_ : rate_)[i] = command_[i];
        field.height[i] = next_height_[i] = base_[i] + axle_ + support_point(angle_[i]).z();
      }
    }
  }

  void plan(double dt_s, Field& field) noexcept override {
    plan_rates(dt_s);
    for (std::size_t r = 0; r < active_.size(); ++r)
      if (active_[r])
        for (int i = command_.runs()[r].begin; i < command_.runs()[r].end; ++i)
          plan_cell(i, static_cast<float>(dt_s), field);
    field.max_height = std::max(field.max_height, max_base_height_ + axle_ + max_radius_);
  }

  void commit(double, Field& field) noexcept override {
    for (std::size_t r = 0; r < active_.size(); ++r) {
      if (!active_[r]) continue;
      for (int i = command_.runs()[r].begin; i < command_.runs()[r].end; ++i)
        field.height[i] = next_height_[i];
      active_[r] = active_[r] == 2;
    }
  }

  bool has_surface_velocity() const noexcept override { return true; }
  void write_cell_motion(std::span<scene::ActuatorState> motion) const noexcept override {
    for (const CellRun& run : command_.runs())
      for (int i = run.begin; i < run.end; ++i) motion[i].a = wrapped(angle_[i]);
  }

  void archive(common::StateArchive& a) override { a(command_, angle_, rate_, next_height_, active_); }

 private:
  void plan_rates(double dt_s) noexcept {
    const MotionProfile profile(max_rate_, max_acceleration_, static_cast<float>(dt_s));
    command_.step(dt_s);
    for (std::size_t r = 0; r < active_.size(); ++r) {
      active_[r] |= static_cast<std::uint8_t>(command_.changed(r));
      if (!active_[r]) continue;
      bool moving = false;
      for (int i = command_.runs()[r].begin; i < command_.runs()[r].end; ++i) {
        rate_[i] = angle_control_ ? profile(command_[i] - angle_[i], rate_[i]) : command_[i];
        moving |= rate_[i] != 0.0F || (angle_control_ && command_[i] != angle_[i]);
      }
      active_[r] = moving ? 2 : 1;  // 1: one more step sets the velocities to 0
    }
  }

  static float wrapped(float angle) {  // into −π to π
    return std::remainder(angle, static_cast<float>(2.0 * std::numbers::pi));
  }

  // `speed` is the mean over the step, so that the top meets the shape's support point at the end of the
  // step.
  void plan_cell(int i, float dt_s, Field& field) noexcept {
    angle_[i] = angle_control_ ? MotionProfile::advance(angle_[i], rate_[i], command_[i], dt_s)
                               : wrapped(angle_[i] + rate_[i] * dt_s);
    const Eigen::Vector3f p = support_point(angle_[i]);
    next_height_[i] = base_[i] + axle_ + p.z();
    field.speed[i] = (next_height_[i] - field.height[i]) / dt_s;
    field.max_speed = std::max(field.max_speed, std::abs(field.speed[i]));
    const Eigen::AngleAxisf cell_rotation(field.angle_of(i), Eigen::Vector3f::UnitZ());
    const Eigen::Vector3f surface_velocity = rate_[i] * (cell_rotation * axis_.cross(p));
    field.surface_velocity_x[i] = surface_velocity.x();
    field.surface_velocity_y[i] = surface_velocity.y();
    field.surface_spin[i] = rate_[i] * axis_.z();
  }

  Eigen::Vector3f support_point(float angle) const {
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

  bool angle_control_;
  Eigen::Vector3f axis_, half_axes_;
  std::vector<Eigen::Vector3f> points_;  // vertices of the shape, u; empty for an ellipsoid
  float axle_, max_radius_;              // height of the axle; maximum distance of the shape from it, u
  float max_rate_, max_acceleration_;
  RateLimitedLag command_;  // rad or rad/s
  // rows × columns; u, rad, rad/s, u
  std::vector<float> base_, angle_, rate_, next_height_;
  // One per run: 0 at rest, 1 in the step that returns the velocities to 0, 2 moving.
  std::vector<std::uint8_t> active_;
  float max_base_height_ = 0.0F;
};

}  // namespace

std::unique_ptr<Actuator> make_rotors(const ActuatorContext& context) {
  return std::make_unique<Rotors>(context);
}

}  // namespace smartsurf::surface

// Delta robots: tips that move in three directions within a workspace.
#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>

#include "smartsurf/scene/Delta.h"
#include "smartsurf/surface/actuators/Models.h"
#include "smartsurf/surface/actuators/MotionProfile.h"
#include "smartsurf/surface/actuators/RunMotion.h"

namespace smartsurf::surface {
namespace {

using Vec = Eigen::Vector3f;

template <class Visit>
void for_each_cell_of(const CellRun& run, Visit visit) {
  for (int i = run.begin; i < run.end; ++i) visit(i);
}

class Deltas final : public Actuator {
 public:
  explicit Deltas(const ActuatorContext& context)
      : runs_(context.runs),
        delta_(context.spec),
        yields_(!delta_.is_rigid() || delta_.has_force_limit()),
        max_speed_(context.number("max_speed")),
        max_acceleration_(context.number("max_acceleration")),
        base_(context.field.height),
        position_(base_.size(), Vec::Zero()),
        velocity_(position_),
        deflection_(position_),
        motion_(runs_.size()) {
    target_.fill(std::vector<float>(base_.size(), 0.0F));
  }

  void set_targets(int channel, std::span<const float> targets) noexcept override {
    std::vector<float>& target = target_[channel];
    for (std::size_t r = 0; r < runs_.size(); ++r)
      for_each_cell_of(runs_[r], [&](std::size_t i) {
        if (target[i] == targets[i]) return;
        target[i] = targets[i];
        motion_.set_moving(r);
      });
  }

  void snap_to_targets(Field& field) noexcept override {
    for (std::size_t r = 0; r < runs_.size(); ++r) {
      float max_height = kNoCellHeight;
      for_each_cell_of(runs_[r], [&](std::size_t i) {
        position_[i] = target_of(i);
        place(i, field);
        max_height = std::max(max_height, field.height[i]);
      });
      motion_.set_at_rest(r, max_height);
    }
  }

  void plan(double dt_s, Field& field) noexcept override {
    const auto dt = static_cast<float>(dt_s);
    const MotionProfile profile(max_speed_, max_acceleration_, dt);
    // The load may move any tip that yields, so all of them are planned in every step.
    motion_.plan(yields_, field, [&](std::size_t r) { return plan_run(runs_[r], profile, dt, field); });
  }

  void commit(double dt_s, Field& field) noexcept override {
    const auto dt = static_cast<float>(dt_s);
    for (std::size_t r = 0; r < runs_.size(); ++r) {
      if (!motion_.is_moving(r) && !yields_) continue;
      for_each_cell_of(runs_[r], [&](std::size_t i) {
        if (yields_) {
          velocity_[i] = field.yielding[i].held_velocity;
          deflection_[i] += field.yielding[i].deflection_rate * dt;
        } else {
          velocity_[i].z() = field.speed[i];  // as the physics lowered it
        }
        const Vec target = target_of(i);
        for (int axis = 0; axis < 3; ++axis)
          position_[i][axis] =
              MotionProfile::advance(position_[i][axis], velocity_[i][axis], target[axis], dt, field.pitch);
        place(i, field);
      });
    }
  }

  std::optional<TipKind> tip() const noexcept override {
    const bool is_sphere = delta_.tip_shape == scene::DeltaTipShape::kSphere;
    CellTip tip{is_sphere ? CellTip::Shape::kSphere : CellTip::Shape::kRoundedCylinder,
                static_cast<float>(delta_.tip_radius), static_cast<float>(delta_.tip_length)};
    tip.stiffness = static_cast<float>(delta_.stiffness);
    tip.damping = static_cast<float>(delta_.damping);
    tip.max_force = static_cast<float>(delta_.max_force);
    tip.workspace_radius = static_cast<float>(delta_.workspace_radius);
    tip.workspace_low = static_cast<float>(delta_.workspace_z[0]);
    tip.workspace_high = static_cast<float>(delta_.workspace_z[1]);
    return TipKind{
        tip, static_cast<float>(delta_.workspace_radius + delta_.tip_radius + 2.0 * delta_.max_deflection())};
  }

  void write_cell_motion(std::span<scene::ActuatorState> motion) const noexcept override {
    const auto per_radius = static_cast<float>(1.0 / delta_.workspace_radius);
    for (const CellRun& run : runs_)
      for_each_cell_of(run, [&](std::size_t i) {
        const Vec tip = per_radius * (position_[i] + deflection_[i]);
        motion[i].a = tip.x(), motion[i].b = tip.y();
      });
  }

  bool has_joints() const noexcept override { return true; }
  void write_joint_positions(std::span<float> positions) const noexcept override {
    for (const CellRun& run : runs_)
      for_each_cell_of(run, [&](std::size_t i) {
        const std::array<double, 3> joints = delta_.joint_positions(position_[i].cast<double>());
        for (std::size_t k = 0; k < joints.size(); ++k)
          positions[k * position_.size() + i] = static_cast<float>(joints[k]);
      });
  }

  void archive(common::StateArchive& a) override { a(target_, position_, velocity_, deflection_, motion_); }

 private:
  // The target within the workspace: beyond its radius the nearest point.
  Vec target_of(std::size_t cell) const noexcept {
    Vec target(target_[0][cell], target_[1][cell], target_[2][cell]);
    const float distance = target.head<2>().norm(), radius = static_cast<float>(delta_.workspace_radius);
    if (distance > radius) target.head<2>() *= radius / distance;
    return target;
  }

  // Writes the position of the tip to the field.
  void place(std::size_t cell, Field& field) const noexcept {
    const Vec tip = position_[cell] + deflection_[cell];
    field.offset[cell] = tip.head<2>();
    field.height[cell] = base_[cell] + tip.z();
  }

  // Velocity at which the spring returns an unloaded tip.
  Vec return_velocity(const Vec& deflection, float dt_s) const noexcept {
    constexpr float kNegligible = 1e-6F;  // of the workspace
    if (deflection.norm() < kNegligible * static_cast<float>(delta_.workspace_radius))
      return deflection / -dt_s;
    const auto decay_rate = static_cast<float>(delta_.stiffness / delta_.damping);
    return deflection * (std::expm1(-decay_rate * dt_s) / dt_s);
  }

  RunMotion::Bounds plan_run(const CellRun& run, const MotionProfile& profile, float dt_s,
                             Field& field) noexcept {
    RunMotion::Bounds bounds;
    for_each_cell_of(run, [&](std::size_t i) {
      const Vec distance = target_of(i) - position_[i];
      for (int axis = 0; axis < 3; ++axis) velocity_[i][axis] = profile(distance[axis], velocity_[i][axis]);
      Vec velocity = velocity_[i];
      if (yields_) {
        YieldingTip& y = field.yielding[i];
        y = {position_[i], velocity_[i], deflection_[i], return_velocity(deflection_[i], dt_s)};
        velocity += y.deflection_rate;
      }
      field.offset_rate[i] = velocity.head<2>();
      field.speed[i] = velocity.z();
      bounds.max_height =
          std::max({bounds.max_height, field.height[i], field.height[i] + velocity.z() * dt_s});
      bounds.max_speed = std::max(bounds.max_speed, velocity.norm());
    });
    return bounds;
  }

  std::vector<CellRun> runs_;
  scene::Delta delta_;
  bool yields_;
  float max_speed_, max_acceleration_;
  std::vector<float> base_;  // rows × columns, u
  // rows × columns, relative to the middle of the cell's base, u: commands; where the joints hold the tips,
  // and how fast they move; their deflection.
  std::array<std::vector<float>, 3> target_;
  std::vector<Vec> position_, velocity_, deflection_;
  RunMotion motion_;
};

}  // namespace

std::unique_ptr<Actuator> make_deltas(const ActuatorContext& context) {
  return std::make_unique<Deltas>(context);
}

}  // namespace smartsurf::surface

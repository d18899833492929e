// Tiles with three degrees of freedom: heave, roll and pitch of each top, which follow trapezoidal motion
// profiles.
//
// A level tile at rest is a column like a pin. Otherwise its top is a plate, which turns about the top's
// centre.
#include <algorithm>
#include <array>
#include <cmath>

#include "smartsurf/surface/actuators/Models.h"
#include "smartsurf/surface/actuators/MotionProfile.h"
#include "smartsurf/surface/actuators/RunMotion.h"

namespace smartsurf::surface {
namespace {

class TiltingTiles final : public Actuator {
 public:
  explicit TiltingTiles(const ActuatorContext& context)
      : runs_(context.runs),
        half_top_x_(context.field.half_top_x),
        half_top_y_(context.field.half_top_y),
        thickness_(context.number("thickness")),
        max_speed_(context.number("max_speed")),
        max_acceleration_(context.number("max_acceleration")),
        max_tilt_rate_(context.number("max_tilt_rate")),
        max_tilt_acceleration_(context.number("max_tilt_acceleration")),
        base_(context.field.height),
        tilt_(base_.size()),
        motion_(runs_.size()) {
    target_.fill(std::vector<float>(base_.size(), 0.0F));
    target_[kHeave] = base_;
  }

  void set_targets(int channel, std::span<const float> targets) noexcept override {
    std::vector<float>& target = target_[channel];
    for (std::size_t r = 0; r < runs_.size(); ++r)
      for (int i = runs_[r].begin; i < runs_[r].end; ++i) {
        const float value = channel == kHeave ? base_[i] + targets[i] : targets[i];
        if (target[i] == value) continue;
        target[i] = value;
        motion_.set_moving(r);
      }
  }

  void snap_to_targets(Field& field) noexcept override {
    for (std::size_t r = 0; r < runs_.size(); ++r) {
      float max_height = kNoCellHeight;
      for (int i = runs_[r].begin; i < runs_[r].end; ++i) {
        field.height[i] = target_[kHeave][i];
        field.tilt[i] = tilt_[i] = {target_[kRoll][i], target_[kPitch][i]};
        max_height = std::max(max_height, max_corner_height(field.height[i], tilt_[i]));
      }
      motion_.set_at_rest(r, max_height);
    }
  }

  void plan(double dt_s, Field& field) noexcept override {
    const auto dt = static_cast<float>(dt_s);
    const MotionProfile heave(max_speed_, max_acceleration_, dt),
        tilt(max_tilt_rate_, max_tilt_acceleration_, dt);
    motion_.plan(false, field, [&](std::size_t r) { return plan_run(runs_[r], heave, tilt, dt, field); });
  }

  void commit(double dt_s, Field& field) noexcept override {
    const auto dt = static_cast<float>(dt_s);
    for (std::size_t r = 0; r < runs_.size(); ++r)
      for (int i = runs_[r].begin; motion_.is_moving(r) && i < runs_[r].end; ++i) {
        const TopTilt& rate = field.tilt_rate[i];
        field.height[i] =
            MotionProfile::advance(field.height[i], field.speed[i], target_[kHeave][i], dt, field.pitch);
        tilt_[i] = {MotionProfile::advance(tilt_[i].roll, rate.roll, target_[kRoll][i], dt),
                    MotionProfile::advance(tilt_[i].pitch, rate.pitch, target_[kPitch][i], dt)};
        field.tilt[i] = tilt_[i];
      }
  }

  std::optional<TipKind> tip() const noexcept override {
    return TipKind{{CellTip::Shape::kPlate, 0.0F, thickness_},
                   std::hypot(half_top_x_, half_top_y_) + thickness_};
  }

  void write_cell_motion(std::span<scene::ActuatorState> motion) const noexcept override {
    for (const CellRun& run : runs_)
      for (int i = run.begin; i < run.end; ++i) motion[i].a = tilt_[i].roll, motion[i].b = tilt_[i].pitch;
  }

  void archive(common::StateArchive& a) override { a(target_, tilt_, motion_); }

 private:
  enum Axis { kHeave, kRoll, kPitch, kAxes };
  // Upper bound of the height of the tile's corners, u.
  float max_corner_height(float height, const TopTilt& t) const noexcept {
    return height + half_top_x_ * std::abs(t.pitch) + half_top_y_ * std::abs(t.roll);
  }

  RunMotion::Bounds plan_run(const CellRun& run, const MotionProfile& heave, const MotionProfile& tilt,
                             float dt_s, Field& field) noexcept {
    const float farthest = std::hypot(half_top_x_, half_top_y_, thickness_);
    RunMotion::Bounds bounds;
    for (int i = run.begin; i < run.end; ++i) {
      float& speed = field.speed[i];
      TopTilt& rate = field.tilt_rate[i];
      speed = heave(target_[kHeave][i] - field.height[i], speed);
      rate = {tilt(target_[kRoll][i] - tilt_[i].roll, rate.roll),
              tilt(target_[kPitch][i] - tilt_[i].pitch, rate.pitch)};
      const TopTilt next{tilt_[i].roll + rate.roll * dt_s, tilt_[i].pitch + rate.pitch * dt_s};
      bounds.max_height = std::max({bounds.max_height, max_corner_height(field.height[i], tilt_[i]),
                                    max_corner_height(field.height[i] + speed * dt_s, next)});
      bounds.max_speed = std::max(bounds.max_speed,
                                  std::abs(speed) + farthest * (std::abs(rate.roll) + std::abs(rate.pitch)));
    }
    return bounds;
  }

  std::vector<CellRun> runs_;
  float half_top_x_, half_top_y_, thickness_;  // u
  float max_speed_, max_acceleration_, max_tilt_rate_, max_tilt_acceleration_;
  std::vector<float> base_;  // rows × columns, u
  // By axis; rows × columns: z of the top, u, base included; roll and pitch, rad.
  std::array<std::vector<float>, kAxes> target_;
  std::vector<TopTilt> tilt_;  // rows × columns
  RunMotion motion_;
};

}  // namespace

std::unique_ptr<Actuator> make_tilting_tiles(const ActuatorContext& context) {
  return std::make_unique<TiltingTiles>(context);
}

}  // namespace smartsurf::surface

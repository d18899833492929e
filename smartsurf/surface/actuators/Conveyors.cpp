// Cells whose tops drive objects as a rigid plate would: with a velocity along x and y and a spin about the
// vertical. Some of them rise. Belts, rollers, steered and omnidirectional wheels and turntables are commands
// of these channels.
#include <algorithm>
#include <array>
#include <cmath>

#include "smartsurf/surface/actuators/Models.h"
#include "smartsurf/surface/actuators/MotionProfile.h"
#include "smartsurf/surface/actuators/RateLimitedLag.h"

namespace smartsurf::surface {
namespace {

class Conveyors final : public Actuator {
 public:
  explicit Conveyors(const ActuatorContext& context)
      : drive_{component(context, "max_acceleration"), component(context, "max_acceleration"),
               component(context, "max_turn_acceleration")},
        per_max_speed_(1.0F / context.number("max_speed")),
        per_max_turn_(1.0F / context.number("max_turn")),
        rises_(context.spec.numbers("lift")[0] < context.spec.numbers("lift")[1]),
        lift_speed_(context.number("lift_speed")),
        lift_acceleration_(context.number("lift_acceleration")),
        base_(context.field.height),
        target_height_(base_),
        velocity_x_(base_.size(), 0.0F),
        velocity_y_(base_.size(), 0.0F),
        rising_(context.runs.size(), 0) {
    const auto top = static_cast<float>(context.spec.numbers("lift")[1]);
    for (const CellRun& run : context.runs)
      for (int i = run.begin; i < run.end; ++i) highest_ = std::max(highest_, base_[i] + top);
  }

  void set_targets(int channel, std::span<const float> targets) noexcept override {
    if (channel < kComponents) return drive_[channel].set_targets(targets);
    for (std::size_t r = 0; r < rising_.size(); ++r)
      for (int i = runs()[r].begin; i < runs()[r].end; ++i) {
        const float height = base_[i] + targets[i];
        rising_[r] |= static_cast<std::uint8_t>(height != target_height_[i]);
        target_height_[i] = height;
      }
  }

  void snap_to_targets(Field& field) noexcept override {
    for (RateLimitedLag& c : drive_) c.snap_to_targets();
    for (std::size_t r = 0; r < runs().size(); ++r) {
      write_velocity(runs()[r], field);
      for (int i = runs()[r].begin; i < runs()[r].end; ++i) field.height[i] = target_height_[i];
      rising_[r] = 0;
    }
  }

  void plan(double dt_s, Field& field) noexcept override {
    for (RateLimitedLag& c : drive_) c.step(dt_s);
    const auto changed = [&](std::size_t r) {
      return std::ranges::any_of(drive_, [r](const RateLimitedLag& c) { return c.changed(r); });
    };
    for (std::size_t r = 0; r < runs().size(); ++r) {
      if (changed(r)) write_velocity(runs()[r], field);
      if (rising_[r]) plan_lift(r, static_cast<float>(dt_s), field);
    }
    if (rises_) field.max_height = std::max(field.max_height, highest_);
  }

  void commit(double dt_s, Field& field) noexcept override {
    for (std::size_t r = 0; r < rising_.size(); ++r)
      for (int i = runs()[r].begin; rising_[r] != 0 && i < runs()[r].end; ++i)
        field.height[i] = MotionProfile::advance(field.height[i], field.speed[i], target_height_[i],
                                                 static_cast<float>(dt_s), field.pitch);
  }

  bool has_surface_velocity() const noexcept override { return true; }

  void write_cell_motion(std::span<scene::ActuatorState> motion) const noexcept override {
    for (const CellRun& run : runs())
      for (int i = run.begin; i < run.end; ++i)
        motion[i] = {velocity_x_[i] * per_max_speed_, velocity_y_[i] * per_max_speed_,
                     drive_[kTurn][i] * per_max_turn_};
  }

  void archive(common::StateArchive& a) override {
    for (RateLimitedLag& c : drive_) a(c);
    a(velocity_x_, velocity_y_, target_height_, rising_);
  }

 private:
  enum Component { kX, kY, kTurn, kComponents };

  static RateLimitedLag component(const ActuatorContext& context, const char* limit) {
    return {context, 0.0F, context.spec.number(limit), context.spec.number("lag")};
  }
  std::span<const CellRun> runs() const noexcept { return drive_[kX].runs(); }

  void write_velocity(const CellRun& run, Field& field) noexcept {
    for (int i = run.begin; i < run.end; ++i) {
      float x = drive_[kX][i], y = drive_[kY][i];
      if (const float angle = field.angle_of(i); angle != 0.0F) {
        const float cosine = std::cos(angle), sine = std::sin(angle), east = x;
        x = cosine * east - sine * y, y = sine * east + cosine * y;
      }
      velocity_x_[i] = x, velocity_y_[i] = y;
      field.surface_velocity_x[i] = x, field.surface_velocity_y[i] = y;
      field.surface_spin[i] = drive_[kTurn][i];
    }
  }

  void plan_lift(std::size_t run, float dt_s, Field& field) noexcept {
    const MotionProfile profile(lift_speed_, lift_acceleration_, dt_s);
    float fastest = 0.0F;
    for (int i = runs()[run].begin; i < runs()[run].end; ++i) {
      field.speed[i] = profile(target_height_[i] - field.height[i], field.speed[i]);
      fastest = std::max(fastest, std::abs(field.speed[i]));
    }
    rising_[run] = static_cast<std::uint8_t>(fastest != 0.0F);
    field.max_speed = std::max(field.max_speed, fastest);
  }

  std::array<RateLimitedLag, kComponents> drive_;  // u/s, u/s, rad/s, in the cell's own axes
  float per_max_speed_, per_max_turn_;
  bool rises_;
  float lift_speed_, lift_acceleration_;
  std::vector<float> base_, target_height_;     // of a cell at rest, and its target; u
  std::vector<float> velocity_x_, velocity_y_;  // in the table's axes, u/s
  std::vector<std::uint8_t> rising_;            // one per run
  float highest_ = kNoCellHeight;               // that any cell can reach, u
};

}  // namespace

std::unique_ptr<Actuator> make_conveyors(const ActuatorContext& context) {
  return std::make_unique<Conveyors>(context);
}

}  // namespace smartsurf::surface

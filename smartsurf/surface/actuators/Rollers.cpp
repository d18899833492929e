// Cells whose tops drive objects in any horizontal direction: a ball that rolls about two axes, or two
// perpendicular omnidirectional wheels. The surface velocity is a linear map of the two spins.
#include <Eigen/Geometry>
#include <bit>
#include <cmath>
#include <cstdint>
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
        spinning_(context.runs.size(), 0) {}

  void set_targets(int channel, std::span<const float> targets) noexcept override {
    spin_[channel].set_targets(targets);
  }

  void snap_to_targets(Field& field) noexcept override {
    for (RateLimitedLag& s : spin_) s.snap_to_targets();
    for (std::size_t r = 0; r < spinning_.size(); ++r) {
      spinning_[r] = 1;
      update_surface_velocity(spin_[0].runs()[r], field);
    }
  }

  void plan(double dt_s, Field& field) noexcept override {
    for (RateLimitedLag& s : spin_) s.step(dt_s);
    for (std::size_t r = 0; r < spinning_.size(); ++r) {
      const CellRun& run = spin_[0].runs()[r];
      if (spin_[0].changed(r) || spin_[1].changed(r)) {
        update_surface_velocity(run, field);
        spinning_[r] = 1;
      }
      if (spinning_[r]) spinning_[r] = advance_angles(run, static_cast<float>(dt_s));
    }
  }

  bool has_surface_velocity() const noexcept override { return true; }

  void write_cell_motion(std::span<scene::ActuatorState> motion) const noexcept override {
    for (const CellRun& run : spin_[0].runs())
      for (int i = run.begin; i < run.end; ++i) motion[i].a = angle_[0][i], motion[i].b = angle_[1][i];
  }

  void archive(common::StateArchive& a) override { a(spin_[0], spin_[1], angle_[0], angle_[1], spinning_); }

 private:
  void update_surface_velocity(const CellRun& run, Field& field) noexcept {
    for (int i = run.begin; i < run.end; ++i) {
      Eigen::Vector2f v = drive_matrix_ * Eigen::Vector2f(spin_[0][i], spin_[1][i]);
      if (!field.is_rectangular()) v = Eigen::Rotation2Df(field.angle_of(i)) * v;
      field.surface_velocity_x[i] = v.x();
      field.surface_velocity_y[i] = v.y();
    }
  }

  // Returns whether any cell spins.
  bool advance_angles(const CellRun& run, float dt_s) noexcept {
    constexpr auto kTwoPi = static_cast<float>(2.0 * std::numbers::pi);
    // The bits of magnitudes are in their order, and compilers vectorise loops over integers.
    constexpr auto bits_of = [](float a) { return std::bit_cast<std::int32_t>(a) & INT32_MAX; };
    std::int32_t spinning = 0;
    for (int k = 0; k < 2; ++k) {
      float* const angle = angle_[k].data();
      const float* const spin = spin_[k].values().data();
      std::int32_t beyond = 0;
      for (int i = run.begin; i < run.end; ++i) {
        angle[i] += spin[i] * dt_s;
        beyond |= bits_of(angle[i]) > bits_of(0.5F * kTwoPi) ? 1 : 0;
        spinning |= bits_of(spin[i]);
      }
      // std::remainder is slow, and few steps end a turn.
      for (int i = run.begin; beyond != 0 && i < run.end; ++i)
        if (std::abs(angle[i]) > 0.5F * kTwoPi) angle[i] = std::remainder(angle[i], kTwoPi);
    }
    return spinning != 0;
  }

  Eigen::Matrix2f drive_matrix_;
  std::vector<RateLimitedLag> spin_;       // two
  std::vector<std::vector<float>> angle_;  // of both; rows × columns, rad
  std::vector<std::uint8_t> spinning_;     // one per run
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

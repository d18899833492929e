// Tiles with three degrees of freedom: heave, roll and pitch of each top, which follow trapezoidal motion profiles.
//
// A level tile at rest is a column like a pin. Otherwise its top is a plate, which turns about the top's centre.
#pragma once

#include <array>

#include "smartsurf/surface/actuators/Actuator.h"

namespace smartsurf::surface {

class MotionProfile;

class TiltingTiles final : public Actuator {
 public:
  explicit TiltingTiles(const ActuatorContext&);

  void set_targets(int channel, std::span<const float> targets) noexcept override;
  void snap_to_targets(Field&) noexcept override;
  void plan(double dt_s, Field&) noexcept override;
  void commit(double dt_s, Field&) noexcept override;
  std::optional<TipKind> tip() const noexcept override;
  void write_cell_motion(std::span<scene::ActuatorState>) const noexcept override;

  void archive(common::StateArchive& a) override {
    a(target_, tilt_, moving_, run_max_height_, run_max_speed_);
  }

 private:
  enum Axis { kHeave, kRoll, kPitch, kAxes };
  // Upper bound of the height of the tile's corners, u.
  float max_corner_height(float height, const TopTilt&) const noexcept;
  void plan_run(std::size_t run, const MotionProfile& heave, const MotionProfile& tilt, float dt_s,
                Field&) noexcept;

  std::vector<CellRun> runs_;
  float half_top_x_, half_top_y_, thickness_;  // u
  float max_speed_, max_acceleration_, max_tilt_rate_, max_tilt_acceleration_;
  std::vector<float> base_;  // rows × columns, u
  // By axis; rows × columns: z of the top, u, base included; roll and pitch, rad.
  std::array<std::vector<float>, kAxes> target_;
  std::vector<TopTilt> tilt_;  // rows × columns
  // One per run, so that runs at rest on their targets cost nothing.
  std::vector<std::uint8_t> moving_;
  std::vector<float> run_max_height_, run_max_speed_;
};

}  // namespace smartsurf::surface

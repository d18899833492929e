// The pins of the surface as flat arrays: each follows its target height within limits of speed and
// acceleration.
//
// One physics step is plan(dt), then the collision sees the pins at their old heights moving at speed(), then
// commit(dt) moves them: detecting at the new heights as well would count the motion twice.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/surface/Field.h"

namespace smartsurf::surface {

class PinField {
 public:
  // All pins stand still at the bottom of their range, the border ring at its own height.
  explicit PinField(const scene::SurfaceSpec&);

  // The pins as the physics meets them; the physics writes its impulses there.
  Field& field() noexcept { return field_; }

  int rows() const noexcept { return rows_; }
  int columns() const noexcept { return columns_; }
  double pitch() const noexcept { return pitch_; }
  double half_top_x() const noexcept { return half_top_x_; }
  double half_top_y() const noexcept { return half_top_y_; }

  // rows × columns, row-major, row 0 north.
  std::span<const float> height() const noexcept { return field_.height; }  // z of the top, u
  std::span<const float> speed() const noexcept {
    return field_.speed;
  }                                                                   // upward, u/s, of the step being taken
  std::span<const float> target() const noexcept { return target_; }  // u, within the range

  // Every cell's target at once; values are clamped to the range, a NaN keeps the cell's old target, border
  // cells keep their height. targets.size() must be rows × columns.
  void set_targets(std::span<const float> targets) noexcept;
  void set_target(int row, int column, float height) noexcept;

  // Sets the speed of the step to come: the fastest approach to the target that can still stop on it.
  void plan(double dt_s) noexcept;
  // Moves the pins by that speed.
  void commit(double dt_s) noexcept;

  // The highest top and the greatest speed |u/s| in the field, as of the last plan().
  float max_height() const noexcept { return field_.max_height; }
  float max_speed() const noexcept { return field_.max_speed; }

 private:
  void plan_row(std::size_t row, float dt_s) noexcept;
  void commit_row(std::size_t row, float dt_s) noexcept;

  int rows_, columns_;
  double pitch_, half_top_x_, half_top_y_;
  float low_, high_, speed_limit_, acceleration_limit_;
  bool has_border_;
  Field field_;
  std::vector<float> target_;
  // One a row, so that a row whose pins all rest on their targets costs nothing.
  std::vector<std::uint8_t> moving_;
  std::vector<float> row_height_, row_speed_;  // the row's highest top and greatest |speed|
};

}  // namespace smartsurf::surface

// The surface as the physics meets it during one step: flat arrays, one entry a cell, row-major, row 0 north.
//
// Actuator models write what the cells do, the physics reads it and writes back what the objects did to the
// cells. One step is: the models plan it (height is the old one, speed and drag are those of the step to
// come), the physics steps against that, the models commit their motion.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <vector>

namespace smartsurf::surface {

// The height of a cell that is not there: nothing rests on it, nothing collides with it.
inline constexpr float kNoCellHeight = -std::numeric_limits<float>::infinity();

struct Field {
  // ---- shape, constant through a run. The cell (r, c) stands at x = c·pitch, y = (rows − 1 − r)·pitch.
  int rows = 0, columns = 0;
  float pitch = 1.0F;
  float half_top_x = 0.4F, half_top_y = 0.4F;  // half edges of a cell's rectangular top, u
  // For every other layout: where each cell stands and how it is turned about z. Empty in a rectangular one.
  std::vector<float> x, y, angle;

  // ---- what the cells do (written by the actuator models)
  std::vector<float> height;  // z of the top, u; kNoCell where there is none
  std::vector<float> speed;   // of the top, upward, u/s
  // Velocity of the top's surface at its centre, u/s, and its turning about the vertical through the centre,
  // rad/s: what drags along whatever lies on it. Empty where no actuator of the surface drags.
  std::vector<float> surface_velocity_x, surface_velocity_y, surface_spin;
  float max_height = 0.0F, max_speed = 0.0F;  // the highest top, and the greatest |speed|
  // The greatest upward force that the cell can give, mass·u/s²; infinity: any. Under more it gives way: the
  // physics then lowers its `speed` to that of what lies on it. Empty where no actuator has such a limit.
  std::vector<float> force_limit;

  // ---- what the objects do to the cells (written by the physics, each step anew)
  std::vector<float> impulse;  // normal impulse on the cell, mass·u/s, ≥ 0

  int cells() const { return rows * columns; }
  int index(int row, int column) const { return row * columns + column; }
  Eigen::Vector2f centre(int cell) const {
    if (!is_rectangular()) return {x[static_cast<std::size_t>(cell)], y[static_cast<std::size_t>(cell)]};
    return {static_cast<float>(cell % columns) * pitch,
            static_cast<float>(rows - 1 - cell / columns) * pitch};
  }
  float angle_of(int cell) const { return is_rectangular() ? 0.0F : angle[static_cast<std::size_t>(cell)]; }
  bool is_rectangular() const { return x.empty(); }
  bool has_surface_velocity() const { return !surface_velocity_x.empty(); }
  bool has_force_limit() const { return !force_limit.empty(); }
};

}  // namespace smartsurf::surface

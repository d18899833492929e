// The surface as the physics sees it during one step: flat arrays, one entry per cell, row-major, row 0
// north.
//
// Actuator models write the motion of the cells; the physics reads it and writes back the impulses. In one
// step the models plan (`height` is the old height, the velocities are those of the coming step), the physics
// steps against the field, and the models commit their motion.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <vector>

#include "common/state/StateArchive.h"

namespace smartsurf::surface {

// Height of a missing cell: nothing collides with it.
inline constexpr float kNoCellHeight = -std::numeric_limits<float>::infinity();

struct Field {
  // ---- geometry, constant during a run. In a rectangular layout cell (r, c) is centred at x = c·pitch,
  // y = (rows − 1 − r)·pitch.
  int rows = 0, columns = 0;
  float pitch = 1.0F;                          // u
  float half_top_x = 0.4F, half_top_y = 0.4F;  // half extents of a cell's rectangular top, u
  // Free layouts only: centre of each cell, u, and its rotation about z, rad. Empty in a rectangular layout.
  std::vector<float> x, y, angle;

  // ---- motion of the cells, written by the actuator models
  std::vector<float> height;  // z of the top, u; kNoCellHeight for a missing cell
  std::vector<float> speed;   // vertical velocity of the top, upward, u/s
  // Tangential velocity of the top's surface at its centre, u/s, and its spin about the vertical axis through
  // the centre, rad/s: friction transfers both to objects. Empty unless an actuator has a surface velocity.
  std::vector<float> surface_velocity_x, surface_velocity_y, surface_spin;
  float max_height = 0.0F, max_speed = 0.0F;  // upper bounds of height, u, and |speed|, u/s
  // Maximum upward force of the cell at rest, mass·u/s²; infinity if unlimited. It falls linearly with the speed at
  // which the cell rises, to 0 at no_load_speed, u/s. Under a greater load the cell yields: the physics lowers its
  // `speed` to that of the load. Empty unless an actuator has a force limit.
  std::vector<float> force_limit, no_load_speed;

  // ---- loads on the cells, overwritten by the physics in every step
  std::vector<float> impulse;  // normal impulse on the cell, mass·u/s, ≥ 0

  // Everything but the geometry.
  void archive_motion(common::StateArchive& a) {
    a(height, speed, surface_velocity_x, surface_velocity_y, surface_spin, max_height, max_speed, force_limit,
      no_load_speed, impulse);
  }

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

// The surface as the physics sees it during one step: flat arrays, one entry per cell, row-major, row 0
// north.
//
// Actuator models write the motion of the cells; the physics reads it and writes back the impulses. In one
// step the models plan (`height` is the old height, the velocities are those of the coming step), the physics
// steps against the field, and the models commit their motion.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "common/state/StateArchive.h"
#include "smartsurf/surface/Skin.h"

namespace smartsurf::surface {

// Height of a missing cell: nothing collides with it.
inline constexpr float kNoCellHeight = -std::numeric_limits<float>::infinity();

// The convex end of a cell that is not a bottomless column with a level rectangular top. Its origin is the
// middle of the cell's top; of a tip that moves sideways, its highest point.
struct CellTip {
  enum class Shape : std::uint8_t {
    kHemisphere,       // a hemisphere of `radius` on a bottomless shaft
    kCone,             // a cone of `radius` and `height`, its apex up, on a bottomless shaft
    kRoundedSquare,    // a bottomless column whose upright edges are rounded with `radius`
    kPlate,            // the cell's top as a plate, `height` thick; while it is level, a bottomless column
    kSphere,           // of `radius`; moves in all directions
    kRoundedCylinder,  // upright, `height` long, both ends hemispheres of `radius`; moves in all directions
    kElasticTop,       // a bottomless column whose top yields as springs do
  };
  Shape shape = Shape::kHemisphere;
  float radius = 0.0F, height = 0.0F;  // u
  // The stiffness and damping with which joints hold a tip that moves sideways, or those of an elastic top,
  // mass/s² and mass/s.
  float stiffness = std::numeric_limits<float>::infinity(), damping = 0.0F;
  // ---- of a tip that moves sideways: the greatest normal force, mass·u/s², within a cylindrical workspace,
  // relative to the cell's base, u.
  float max_force = std::numeric_limits<float>::infinity();
  float workspace_radius = 0.0F, workspace_low = 0.0F, workspace_high = 0.0F;

  bool moves_sideways() const { return shape == Shape::kSphere || shape == Shape::kRoundedCylinder; }
  bool yields() const { return moves_sideways() && (std::isfinite(stiffness) || std::isfinite(max_force)); }
};

// The motion of a tip that yields: its position is that in which its joints hold it, plus its deflection.
struct YieldingTip {
  using Vec = Eigen::Vector3f;
  Vec held_position{0, 0, 0}, held_velocity{0, 0, 0};  // from the middle of the cell's base, u; u/s
  Vec deflection{0, 0, 0}, deflection_rate{0, 0, 0};   // u, u/s
};

// Rotation of a cell's top about its x axis, then about the cell's y axis, rad, or its rate, rad/s.
struct TopTilt {
  float roll = 0.0F, pitch = 0.0F;
  bool is_zero() const { return roll == 0.0F && pitch == 0.0F; }
};

struct Field {
  // ---- geometry, constant during a run. In a rectangular layout cell (r, c) is centred at x = c·pitch,
  // y = (rows − 1 − r)·pitch.
  int rows = 0, columns = 0;
  float pitch = 1.0F;                          // u
  float half_top_x = 0.4F, half_top_y = 0.4F;  // half extents of a cell's rectangular top, u
  // Free layouts only: centre of each cell, u, and its rotation about z, rad. Empty in a rectangular layout.
  std::vector<float> x, y, angle;
  // Kinds of tips, and the index in them of each cell's, −1 for a column. Both empty if all cells are
  // columns.
  std::vector<CellTip> tips;
  std::vector<std::int8_t> tip_of_cell;
  bool has_elastic_tops = false;  // whether any cell's top is elastic
  // Upper bound of the horizontal distance of a tip's points from its cell's centre, u.
  float tip_reach = 0.0F;
  Skin skin;  // over the cells; has no nodes if there is none

  // ---- motion of the cells, written by the actuator models
  std::vector<float> height;  // z of the top, u; kNoCellHeight for a missing cell
  std::vector<float> speed;   // vertical velocity of the top, upward, u/s
  // Tangential velocity of the top's surface at its centre, u/s, and its spin about the vertical axis through
  // the centre, rad/s: friction transfers both to objects. Empty unless an actuator has a surface velocity.
  std::vector<float> surface_velocity_x, surface_velocity_y, surface_spin;
  // Tilt of each cell's top about its centre, and the rate of the coming step. Empty if no top tilts.
  std::vector<TopTilt> tilt, tilt_rate;
  // Horizontal position of a tip that moves sideways, from the cell's centre along the table's axes, u, and
  // the velocity of the coming step, u/s. Empty if there are none.
  std::vector<Eigen::Vector2f> offset, offset_rate;
  // The actuator model writes the velocities of tips that yield without load. The physics replaces those of a
  // loaded tip, and with them speed and offset_rate, by those under the load. Empty if no tip yields.
  std::vector<YieldingTip> yielding;
  // Upper bounds of the height and of the speed of any point of a cell, u and u/s.
  float max_height = 0.0F, max_speed = 0.0F;
  // Maximum upward force of the cell at rest, mass·u/s²; infinity if unlimited. It falls linearly with the
  // speed at which the cell rises, to 0 at no_load_speed, u/s. Under a greater load the cell yields: the
  // physics lowers its `speed` to that of the load. Empty unless an actuator has a force limit.
  std::vector<float> force_limit, no_load_speed;

  // ---- loads on the cells, overwritten by the physics in every step
  std::vector<float> impulse;  // normal impulse on the cell, mass·u/s, ≥ 0
  // Impulse on the tip, friction included, mass·u/s. Empty if no tip moves sideways.
  std::vector<Eigen::Vector3f> tip_impulse;

  // Everything but the geometry.
  void archive_motion(common::StateArchive& a) {
    a(height, speed, surface_velocity_x, surface_velocity_y, surface_spin, max_height, max_speed, force_limit,
      no_load_speed, impulse, tilt, tilt_rate);
    if (has_offset()) a(offset, offset_rate, yielding, tip_impulse);
    if (has_skin()) skin.archive_motion(a);
    update_column_height();
  }

  // Call after a change of the motion, if has_tips() or has_skin().
  void update_column_height() {
    if (!has_tips() && !has_skin()) return;
    column_height_.resize(height.size());
    for (std::size_t i = 0; i < height.size(); ++i)
      column_height_[i] = is_column(i) && !is_under_skin(i) ? height[i] : kNoCellHeight;
  }
  // Height of each cell that objects touch as a column; kNoCellHeight for the others.
  const std::vector<float>& column_height() const {
    return has_tips() || has_skin() ? column_height_ : height;
  }

  int cells() const { return rows * columns; }
  int index(int row, int column) const { return row * columns + column; }
  Eigen::Vector2f centre(int cell) const {
    if (!is_rectangular()) return {x[cell], y[cell]};
    return {static_cast<float>(cell % columns) * pitch,
            static_cast<float>(rows - 1 - cell / columns) * pitch};
  }
  float angle_of(int cell) const { return is_rectangular() ? 0.0F : angle[cell]; }
  bool is_rectangular() const { return x.empty(); }
  bool has_surface_velocity() const { return !surface_velocity_x.empty(); }
  bool has_force_limit() const { return !force_limit.empty(); }
  bool has_tips() const { return !tips.empty(); }
  bool has_tilt() const { return !tilt.empty(); }
  bool has_offset() const { return !offset.empty(); }
  bool has_skin() const { return skin.rows > 0; }
  bool is_under_skin(std::size_t cell) const { return has_skin() && skin.covers[cell] != 0; }
  // True if the cell is a bottomless column with a level top.
  bool is_column(std::size_t cell) const {
    if (!has_tips() || tip_of_cell[cell] < 0) return true;
    if (is_elastic(cell)) return true;
    return tip_at(cell).shape == CellTip::Shape::kPlate && tilt[cell].is_zero() && tilt_rate[cell].is_zero();
  }
  bool is_elastic(std::size_t cell) const {
    return has_elastic_tops && tip_of_cell[cell] >= 0 && tip_at(cell).shape == CellTip::Shape::kElasticTop;
  }
  // True if objects touch the cells one by one, because each answers to its own load.
  bool has_contacts_per_cell() const { return has_force_limit() || has_elastic_tops; }
  bool yields(std::size_t cell) const { return !is_column(cell) && tip_at(cell).yields(); }
  // Precondition: the cell has a tip.
  const CellTip& tip_at(std::size_t cell) const { return tips[tip_of_cell[cell]]; }

 private:
  std::vector<float> column_height_;
};

}  // namespace smartsurf::surface

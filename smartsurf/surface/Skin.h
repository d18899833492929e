// A skin over the cells, as the physics sees it during one step: a grid of nodes that move vertically, in
// flat arrays, row-major, row 0 north. Each rectangle of four nodes is two triangles, joined along its
// diagonal from the north-west to the south-east.
//
// It belongs to surface::Field, with its order of events: SkinShape moves the nodes of a kinematic skin, the
// physics those of an elastic one, and the physics writes the impulses on them.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstdint>
#include <vector>

#include "common/state/StateArchive.h"

namespace smartsurf::surface {

struct Skin {
  // ---- geometry, constant during a run. Node (r, c) is at x = west + c·spacing_x, y = north − r·spacing_y.
  int rows = 0, columns = 0;                 // 0: there is no skin
  float west = 0.0F, north = 0.0F;           // u
  float spacing_x = 1.0F, spacing_y = 1.0F;  // u
  std::vector<std::uint8_t> covers;          // [cell]: whether the skin lies over it
  std::vector<std::int32_t> cell_of_node;    // the nearest cell with an actuator under the skin
  // ---- of an elastic skin
  bool is_elastic = false, attached = false;  // attached: the supports also pull
  float tension = 0.0F;                       // mass/s²
  float density = 0.0F;                       // mass/u²
  float damping = 0.0F;                       // of its tension, mass/s
  // The support under each node: its height at the start of the step, u, −infinity without one, and its speed
  // in the step, u/s.
  std::vector<float> support_height, support_speed;
  std::vector<std::uint8_t> is_clamped;  // [node]: at a clamped edge, a support that never lets go

  // ---- motion
  std::vector<float> height;       // z, u
  std::vector<float> speed;        // upward, in the coming step, u/s
  bool supports_move = false;      // in the coming step
  std::vector<std::uint8_t> held;  // [node]: of an elastic skin, whether its support holds it
  // ---- loads, overwritten by the physics in every step
  std::vector<float> impulse;  // downward impulse of the objects on each node, mass·u/s

  std::size_t index(int row, int column) const { return row * columns + column; }
  std::size_t nodes() const { return rows * columns; }
  float east() const { return west + static_cast<float>(columns - 1) * spacing_x; }
  float south() const { return north - static_cast<float>(rows - 1) * spacing_y; }
  Eigen::Vector3f node(int row, int column) const {
    return {west + static_cast<float>(column) * spacing_x, north - static_cast<float>(row) * spacing_y,
            height[index(row, column)]};
  }

  // The triangle at a point of the plane, clamped to the skin, and the point's barycentric coordinates in it.
  struct Location {
    std::size_t node[3];
    float weight[3];
    float interpolate(const std::vector<float>& values) const {
      return weight[0] * values[node[0]] + weight[1] * values[node[1]] + weight[2] * values[node[2]];
    }
  };
  Location locate(float x, float y) const {
    const float u = std::clamp((x - west) / spacing_x, 0.0F, static_cast<float>(columns - 1)),
                v = std::clamp((north - y) / spacing_y, 0.0F, static_cast<float>(rows - 1));
    const int c = std::min(static_cast<int>(u), columns - 2), r = std::min(static_cast<int>(v), rows - 2);
    const float a = u - static_cast<float>(c), b = v - static_cast<float>(r);
    const std::size_t north_west = index(r, c), south_east = index(r + 1, c + 1);
    if (a >= b) return {{north_west, index(r, c + 1), south_east}, {1.0F - a, a - b, b}};
    return {{north_west, index(r + 1, c), south_east}, {1.0F - b, b - a, a}};
  }
  // Slopes dz/dx and dz/dy of the triangle there.
  Eigen::Vector2f slope_at(float x, float y) const {
    const Location at = locate(x, y);
    const float from = height[at.node[0]], corner = height[at.node[1]], to = height[at.node[2]];
    const bool is_northern = at.node[1] == at.node[0] + 1;
    return is_northern ? Eigen::Vector2f((corner - from) / spacing_x, (corner - to) / spacing_y)
                       : Eigen::Vector2f((to - corner) / spacing_x, (from - corner) / spacing_y);
  }

  void archive_motion(common::StateArchive& a) {
    a(height, speed, supports_move, impulse);
    if (is_elastic) a(support_height, support_speed, held);
  }
};

// Visits the edges of the finite elements: each(node, neighbour, weight), with the weight in the Laplacian.
// Linear elements on right triangles have weight 0 along the diagonals, which are left out.
template <class Each>
void for_each_edge(const Skin& s, Each each) {
  const double along_x = static_cast<double>(s.spacing_y) / s.spacing_x, along_y = 1.0 / along_x;
  for (int r = 0; r < s.rows; ++r)
    for (int c = 0; c < s.columns; ++c) {
      const bool is_row_end = r == 0 || r + 1 == s.rows, is_column_end = c == 0 || c + 1 == s.columns;
      if (c + 1 < s.columns) each(s.index(r, c), s.index(r, c + 1), is_row_end ? 0.5 * along_x : along_x);
      if (r + 1 < s.rows) each(s.index(r, c), s.index(r + 1, c), is_column_end ? 0.5 * along_y : along_y);
    }
}

}  // namespace smartsurf::surface

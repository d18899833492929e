// The narrow phase's view of the field: one column per cell, with sides bridged to level neighbours.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>

#include "smartsurf/scene/NarrowGap.h"
#include "smartsurf/surface/Field.h"
#include "smartsurf/world/body/Vec.h"

namespace smartsurf::world {

// If the way out over a bridged side is shorter than all others by this, the neighbour there separates the
// two, u.
inline constexpr float kBridgeShortcut = 0.05F;
// A normal that leans less than this over a bridged side does so by rounding only.
inline constexpr float kLeanTolerance = 0.05F;
// Least cosine of the angle between a level face, or an upright normal, and the vertical. The springs of
// elastic tops let a face tilt.
inline constexpr float kUpright = 0.9999F, kUprightOnElasticTops = 0.99F;
// Greatest height difference of level tops, u.
inline constexpr float kLevelTolerance = 1e-3F;

// The least gap that a body enters, u: as wide as the body, or with a hole between four tops, √2 gaps across,
// that is as wide as its second least extent.
inline float least_gap_entered(float least_width, const Vec3& extents) {
  const float second =
      std::max(std::min(extents.x(), extents.y()), std::min(std::max(extents.x(), extents.y()), extents.z()));
  return std::min(least_width, second / std::numbers::sqrt2_v<float>);
}
// The widest gap between level tops that a body which cannot enter it passes over as over a plane, u. Wider
// ones act as they are; between elastic tops there are none, because a body that they yield to must not meet
// their sides.
inline float max_bridged_gap(const surface::Field& field) {
  constexpr auto kMaxGap = static_cast<float>(scene::kMaxNarrowGap);
  return (field.has_elastic_tops ? 1.0F : kMaxGap) * field.pitch;
}
inline bool is_bridged(const surface::Field& field, float gap, float gap_entered) {
  return gap < gap_entered && gap <= max_bridged_gap(field);
}

// One cell as a bottomless column: its rectangle, extended to the middle of the gap on each bridged side, and
// its top.
struct Column {
  float west, east, south, north, top;
  bool bridged_west, bridged_east, bridged_south, bridged_north;

  bool contains(float x, float y) const { return x >= west && x <= east && y >= south && y <= north; }
  // Greatest projection of its points on a direction that does not point down.
  float max_projection(const Vec3& n) const {
    return n.x() * (n.x() > 0 ? east : west) + n.y() * (n.y() > 0 ? north : south) + n.z() * top;
  }
  bool all_bridged() const { return bridged_west && bridged_east && bridged_south && bridged_north; }
  // True if the normal leans over a bridged side by more than the tolerance; the contact then belongs to the
  // neighbour.
  bool leans_over_bridge(float nx, float ny, float tolerance) const {
    return (nx > tolerance && bridged_east) || (nx < -tolerance && bridged_west) ||
           (ny > tolerance && bridged_north) || (ny < -tolerance && bridged_south);
  }
};

struct CellRange {
  int row_begin, row_end, column_begin, column_end;
};

// The gaps between a cell of a free layout and the level tops across its west, east, north and south side, as
// far as a body reaches along that side.
struct FreeCell {
  std::int32_t cell;
  // Widest distance across, u, and the least gap that a body must not enter: this, the longest stretch of the
  // side without a top across, or that of the hole where the gap meets another one. It is infinite beside
  // tops that are not level, or too far.
  std::array<float, 4> gap, entered;
  bool is_centre_free = true;  // whether no cell reaches up to the body's centre
};

// The cells of a rectangular layout; or one of a free layout, in its own frame.
class Columns {
 public:
  // `gap_entered`: least_gap_entered() of the body, u; 0 for none. `free_cell`: null in a rectangular layout.
  explicit Columns(const surface::Field& field, float gap_entered = 0.0F, const FreeCell* free_cell = nullptr)
      : field_(field),
        height_(field.column_height().data()),
        rows_(field.rows),
        columns_(field.columns),
        pitch_(field.pitch),
        half_x_(field.half_top_x),
        half_y_(field.half_top_y),
        spans_gaps_(gap_entered > pitch_ - 2.0F * std::min(half_x_, half_y_)),
        bridges_x_(is_bridged(field, pitch_ - 2.0F * half_x_, gap_entered)),
        bridges_y_(is_bridged(field, pitch_ - 2.0F * half_y_, gap_entered)),
        free_cell_(free_cell) {
    if (free_cell) set_free_column(gap_entered);
  }

  // True if the body cannot enter the gaps, bridged or not.
  bool spans_gaps() const { return spans_gaps_; }
  // Cells whose bridged columns can touch the rectangle.
  CellRange cells_covering(float x_low, float x_high, float y_low, float y_high) const {
    if (free_cell_) return {0, 1, 0, 1};
    const float inverse = 1.0F / pitch_;
    auto cell = [inverse](float u) { return std::clamp(u * inverse, -1e6F, 1e6F); };
    // The compiler inlines these, unlike std::floor and std::ceil, on the baseline instruction set.
    auto floor = [](float u) {
      const int i = static_cast<int>(u);
      return i - (static_cast<float>(i) > u ? 1 : 0);
    };
    auto ceil = [floor](float u) { return -floor(-u); };
    return {std::max(0, rows_ - 1 - floor(cell(y_high) + 0.5F)),
            std::min(rows_, rows_ - ceil(cell(y_low) - 0.5F)), std::max(0, ceil(cell(x_low) - 0.5F)),
            std::min(columns_, floor(cell(x_high) + 0.5F) + 1)};
  }

  const surface::Field& field() const { return field_; }
  const FreeCell* free_cell() const { return free_cell_; }  // null in a rectangular layout
  float pitch() const { return pitch_; }
  int index(int row, int column) const { return free_cell_ ? free_cell_->cell : row * columns_ + column; }
  float x(int column) const { return static_cast<float>(column) * pitch_; }
  float y(int row) const { return static_cast<float>(rows_ - 1 - row) * pitch_; }
  float top(int row, int column) const { return height_[row * columns_ + column]; }

  float max_height(const CellRange& cells) const {
    float max_top = surface::kNoCellHeight;
    for (int r = cells.row_begin; r < cells.row_end; ++r)
      for (int c = cells.column_begin; c < cells.column_end; ++c) max_top = std::max(max_top, top(r, c));
    return max_top;
  }

  // True if no cell reaches up to the point.
  bool is_free(const Vec3& p) const {
    if (free_cell_) return free_cell_->is_centre_free;
    return max_height(cells_covering(p.x(), p.x(), p.y(), p.y())) < p.z();
  }

  Column at(int row, int column) const {
    if (free_cell_) return free_column_;
    const int i = index(row, column);
    const float top = height_[i];
    auto level = [&](bool inside, int neighbour) {
      return inside && std::abs(height_[neighbour] - top) <= kLevelTolerance;
    };
    Column q;
    q.top = top;
    q.bridged_west = bridges_x_ && level(column > 0, i - 1);
    q.bridged_east = bridges_x_ && level(column < columns_ - 1, i + 1);
    q.bridged_north = bridges_y_ && level(row > 0, i - columns_);
    q.bridged_south = bridges_y_ && level(row < rows_ - 1, i + columns_);
    const float half_pitch = 0.5F * pitch_;
    q.west = x(column) - (q.bridged_west ? half_pitch : half_x_);
    q.east = x(column) + (q.bridged_east ? half_pitch : half_x_);
    q.south = y(row) - (q.bridged_south ? half_pitch : half_y_);
    q.north = y(row) + (q.bridged_north ? half_pitch : half_y_);
    return q;
  }

 private:
  void set_free_column(float gap_entered) {
    rows_ = columns_ = 1;
    height_ += free_cell_->cell;
    spans_gaps_ = true;
    float reach[4];
    bool bridged[4];
    for (std::size_t side = 0; side < 4; ++side) {
      const float entered = free_cell_->entered[side];
      bridged[side] = is_bridged(field_, entered, gap_entered);
      reach[side] = (side < 2 ? half_x_ : half_y_) + (bridged[side] ? free_cell_->gap[side] : 0.0F);
      if (std::isfinite(entered)) spans_gaps_ &= entered < gap_entered;
    }
    free_column_ = {-reach[0],  reach[1],   -reach[3],  reach[2],  height_[0],
                    bridged[0], bridged[1], bridged[3], bridged[2]};
  }

  const surface::Field& field_;
  const float* height_;
  int rows_, columns_;
  float pitch_, half_x_, half_y_;
  bool spans_gaps_, bridges_x_, bridges_y_;
  const FreeCell* free_cell_;
  Column free_column_;
};

// Signed distance to the column's surface and direction of escape for a point inside the column's rectangle:
// up or out of an unbridged side, whichever is nearer. The distance is positive above the top. It is infinite
// in a concave corner, where the nearest unbridged side faces away from the body's centre and the way over a
// bridged side is much shorter. If the body stands `beside` the column, the way up does not count there
// either.
struct EscapeDirection {
  Vec3 normal;
  float distance;
};
inline EscapeDirection escape_direction(const Column& q, const Vec3& p, const Vec3& centre, bool beside) {
  EscapeDirection best{{0, 0, 1}, p.z() - q.top};
  if (best.distance >= 0.0F) return best;
  float over_bridge = -std::numeric_limits<float>::infinity();
  auto try_side = [&](bool bridged, float depth, const Vec3& normal) {
    if (bridged)
      over_bridge = std::max(over_bridge, -depth);
    else if (-depth > best.distance)
      best = {normal, -depth};
  };
  try_side(q.bridged_west, p.x() - q.west, {-1, 0, 0});
  try_side(q.bridged_east, q.east - p.x(), {1, 0, 0});
  try_side(q.bridged_south, p.y() - q.south, {0, -1, 0});
  try_side(q.bridged_north, q.north - p.y(), {0, 1, 0});
  const bool is_up = best.normal.z() > 0.0F;
  if ((is_up ? beside : best.normal.dot(centre - p) < 0.0F) && over_bridge > best.distance + kBridgeShortcut)
    best.distance = std::numeric_limits<float>::infinity();
  return best;
}

}  // namespace smartsurf::world

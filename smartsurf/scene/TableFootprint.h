// Tests whether a point is over the table, seen from above, for any layout.
//
// Each cell owns a square as wide as the pitch, rotated with it; where cells are farther apart, as wide as
// most cells' distance to their nearest neighbour. Gaps and notches less than two pitches wide between these
// squares belong to the table, and so does what they enclose. A rectangular grid without empty cells is
// exactly a rectangle; other outlines are rasters of a quarter of a pitch, coarser for huge ones.
#pragma once

#include <cstdint>
#include <vector>

#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::scene {

class TableFootprint {
 public:
  explicit TableFootprint(const SurfaceSpec&);

  // x, y: u. False for what is not a number.
  bool contains(double x, double y) const noexcept;

 private:
  void rasterize_cell(const CellPose&, double half_side);
  void close_gaps();
  // Every tile becomes `what` that has such a one at most kGap tiles away, along the rows or along the
  // columns.
  void dilate(std::uint8_t label, bool along_rows);
  void fill_holes();
  std::size_t tile_index(int row, int column) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
           static_cast<std::size_t>(column);
  }

  double min_x_, min_y_, max_x_, max_y_;  // of a box around the table, u
  double tile_size_ = 0.0;                // edge of a tile of the raster, u
  int rows_ = 0, columns_ = 0;
  std::vector<std::uint8_t> tiles_;  // rows × columns from the south-west; 1: table. Empty: all of the box is
};

}  // namespace smartsurf::scene

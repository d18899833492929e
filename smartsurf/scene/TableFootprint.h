// Tests whether a point is over the table, seen from above, for any layout.
//
// Each cell covers a square, rotated with the cell, whose edge is the pitch or the median distance to the
// nearest neighbour, whichever is larger. Gaps and notches narrower than two pitches between the squares
// belong to the table, as do enclosed holes. A rectangular grid without empty cells, or under a skin, is an
// exact rectangle. Other outlines are rasterized with tiles of a quarter of the pitch, coarser for huge
// surfaces.
#pragma once

#include <cstdint>
#include <vector>

#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::scene {

class TableFootprint {
 public:
  explicit TableFootprint(const SurfaceSpec&);

  // x, y in u. False for NaN.
  bool contains(double x, double y) const noexcept;

 private:
  void rasterize_cell(const CellPose&, double half_side);
  void close_gaps();
  // Sets every tile to `label` that has a tile with that label within kClosingRadius, in one direction.
  void dilate(std::uint8_t label, bool along_rows);
  void fill_holes();
  std::size_t tile_index(int row, int column) const { return row * columns_ + column; }

  double min_x_, min_y_, max_x_, max_y_;  // bounding box of the table, u
  double tile_size_ = 0.0;                // edge of a raster tile, u
  int rows_ = 0, columns_ = 0;            // of the raster
  // [row][column] from the south-west; 1 = table. Empty = the table fills the bounding box.
  std::vector<std::uint8_t> tiles_;
};

}  // namespace smartsurf::scene

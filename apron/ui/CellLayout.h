// The positions of a register's cells on the screen: squares, or the touching hexagons of a table whose every
// second row is shifted.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "apron/debugger/Probe.h"

namespace apron::ui {

// In widths of a cell from the north-west corner of the register, x east, y south.
struct CellPoint {
  float x = 0.0F, y = 0.0F;
};

struct CellRange {  // half open
  std::uint32_t first_x = 0, end_x = 0, first_y = 0, end_y = 0;
};

class CellLayout {
 public:
  CellLayout() = default;  // squares
  // first_row_shifted: rows 0, 2, … lie half a cell further east than rows 1, 3, …; else the other way round.
  static CellLayout hexagons(bool first_row_shifted);
  // The layout of a surface with these x, y (north) and z of each cell, row-major, row 0 north; squares
  // unless they are the grid of hexagons of that pitch.
  static CellLayout of_surface(std::span<const std::array<float, 3>> positions, std::uint32_t rows,
                               std::uint32_t columns, double pitch);

  bool hexagonal() const { return hexagonal_; }
  float row_pitch() const;
  // True if the row lies half a cell further east than its neighbours.
  bool is_shifted(std::uint32_t row) const { return hexagonal_ && (row % 2 == 0) == first_row_shifted_; }
  // Width and height of the whole register.
  CellPoint extent(std::uint32_t width, std::uint32_t height) const;
  CellPoint centre(const debugger::Cell& cell) const;
  // The cell at a point; nullopt between and beside the cells.
  std::optional<debugger::Cell> cell_at(CellPoint point, std::uint32_t width, std::uint32_t height) const;
  // All cells with a part in the rectangle, and perhaps some beside it.
  CellRange cells_within(CellPoint north_west, CellPoint south_east, std::uint32_t width,
                         std::uint32_t height) const;
  // The corners of a hexagon from its centre, clockwise from the north.
  static const std::array<CellPoint, 6>& hexagon();

 private:
  bool hexagonal_ = false, first_row_shifted_ = false;
};

}  // namespace apron::ui

// Maps of numbers on a grid of cells, several to a picture, each with its scale.
#pragma once

#include <string>
#include <vector>

namespace common {

struct CellMap {
  std::string title;
  std::vector<double> values;  // rows × columns, row 0 on top; not finite: grey
};

// The maps as SVG, side by side, each coloured from its least to its greatest finite value.
// Throws std::runtime_error if Cairo fails.
std::string cell_maps_svg(const std::string& title, int rows, int columns, const std::vector<CellMap>& maps);

}  // namespace common

// Finds cells of a free layout whose tops overlap.
#pragma once

#include <optional>

#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::scene {

struct CellOverlap {
  int first = 0, second = 0;  // indices of the cells, first < second
  double depth = 0.0;         // the shortest distance by which one must move, u
};

// A pair of overlapping cells; touching tops do not overlap. Empty cells have no top. Returns
// nullopt for a rectangular grid, and for coordinates or tops that validate() refuses. O(cells · log cells).
std::optional<CellOverlap> find_overlap(const SurfaceSpec&);

}  // namespace smartsurf::scene

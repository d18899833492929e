// Which cells of a surface exist, as an additional sensor channel of a surface with empty cells.
#pragma once

#include <vector>

#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::scene {

// The channel's name; no sensor of such a surface may have it.
inline constexpr const char* kOccupancyChannel = "occupancy";

// Whether the surface has that channel. Takes time in proportion to the cells.
bool has_empty_cells(const SurfaceSpec&);

// [row][column], row 0 north: 1 where there is a cell and 0 where there is none. Empty where every cell is
// there.
std::vector<float> occupancy_mask(const SurfaceSpec&);

}  // namespace smartsurf::scene

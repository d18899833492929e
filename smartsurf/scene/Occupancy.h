// The occupancy mask: an additional sensor channel that shows which cells exist on a surface with empty
// cells.
#pragma once

#include <vector>

#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::scene {

// The name of the channel, reserved on surfaces with empty cells.
inline constexpr const char* kOccupancyChannel = "occupancy";

// True if the surface has the occupancy channel. O(cells).
bool has_empty_cells(const SurfaceSpec&);

// [row][column], row 0 is north: 1 = cell, 0 = empty. The vector is empty if the surface has no empty cells.
std::vector<float> occupancy_mask(const SurfaceSpec&);

}  // namespace smartsurf::scene

#include "smartsurf/scene/Occupancy.h"

#include <algorithm>

namespace smartsurf::scene {

bool has_empty_cells(const SurfaceSpec& surface) {
  return std::ranges::find(surface.actuator_of_cell, kEmptyCell) != surface.actuator_of_cell.end();
}

std::vector<float> occupancy_mask(const SurfaceSpec& surface) {
  if (!has_empty_cells(surface)) return {};
  std::vector<float> mask;
  for (const std::int8_t actuator : surface.actuator_of_cell)
    mask.push_back(actuator == kEmptyCell ? 0.0F : 1.0F);
  return mask;
}

}  // namespace smartsurf::scene

#include "smartsurf/scene/SurfaceBounds.h"

#include <algorithm>
#include <limits>

namespace smartsurf::scene {

SurfaceBounds compute_surface_bounds(const SurfaceSpec& surface) {
  const double half_pitch = surface.pitch / 2.0;
  if (surface.cell_poses.empty())
    return {-half_pitch, -half_pitch, (surface.columns - 0.5) * surface.pitch,
            (surface.rows - 0.5) * surface.pitch};
  constexpr double kInfinite = std::numeric_limits<double>::max();
  SurfaceBounds bounds{kInfinite, kInfinite, -kInfinite, -kInfinite};
  for (int row = 0; row < surface.rows; ++row)
    for (int column = 0; column < surface.columns; ++column) {
      if (surface.is_empty(row, column)) continue;
      const Eigen::Vector2d centre = surface.centre(row, column);
      bounds = {
          std::min(bounds.west, centre.x() - half_pitch), std::min(bounds.south, centre.y() - half_pitch),
          std::max(bounds.east, centre.x() + half_pitch), std::max(bounds.north, centre.y() + half_pitch)};
    }
  return bounds;
}

}  // namespace smartsurf::scene

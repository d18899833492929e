#include "smartsurf/scene/Outline.h"

#include <algorithm>
#include <limits>

namespace smartsurf::scene {

Outline outline_of(const SurfaceSpec& surface) {
  const double half = surface.pitch / 2.0;
  if (surface.places.empty())
    return {-half, -half, (surface.columns - 0.5) * surface.pitch, (surface.rows - 0.5) * surface.pitch};
  constexpr double kFar = std::numeric_limits<double>::max();
  Outline all{kFar, kFar, -kFar, -kFar};
  for (int row = 0; row < surface.rows; ++row)
    for (int column = 0; column < surface.columns; ++column) {
      if (surface.is_empty(row, column)) continue;
      const Eigen::Vector2d at = surface.centre(row, column);
      all = {std::min(all.west, at.x() - half), std::min(all.south, at.y() - half),
             std::max(all.east, at.x() + half), std::max(all.north, at.y() + half)};
    }
  return all;
}

}  // namespace smartsurf::scene

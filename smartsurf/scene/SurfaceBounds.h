// The bounding rectangle of a surface of any layout.
#pragma once

#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::scene {

struct SurfaceBounds {
  double west = 0.0, south = 0.0, east = 0.0, north = 0.0;  // u
  double width() const { return east - west; }
  double height() const { return north - south; }
  bool contains(double x, double y) const { return x >= west && x <= east && y >= south && y <= north; }
};

// Bounds of all cells, each extending half a pitch from its centre. Empty cells count only on a rectangular
// grid. Requires at least one cell.
SurfaceBounds compute_surface_bounds(const SurfaceSpec&);

}  // namespace smartsurf::scene

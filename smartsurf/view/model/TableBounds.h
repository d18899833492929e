// The bounding box of the table.
#pragma once

#include <Eigen/Geometry>

#include "smartsurf/scene/SurfaceBounds.h"

namespace smartsurf::view {

// Bounding box of the table over the full travel of its pins, u.
inline Eigen::AlignedBox3d surface_bounding_box(const scene::SurfaceSpec& s) {
  const scene::SurfaceBounds bounds = scene::compute_surface_bounds(s);
  return {Eigen::Vector3d(bounds.west, bounds.south, s.pin.min_height - s.pin.length),
          Eigen::Vector3d(bounds.east, bounds.north, s.max_top_height())};
}

}  // namespace smartsurf::view

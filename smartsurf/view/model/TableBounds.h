// The bounding boxes of the table and of what is over it.
#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "smartsurf/scene/Snapshot.h"
#include "smartsurf/scene/SurfaceBounds.h"

namespace smartsurf::view {

// Bounding box of the table over the full travel of its pins, u.
inline Eigen::AlignedBox3d surface_bounding_box(const scene::SurfaceSpec& s) {
  const scene::SurfaceBounds bounds = scene::compute_surface_bounds(s);
  return {Eigen::Vector3d(bounds.west, bounds.south, s.ground_height()),
          Eigen::Vector3d(bounds.east, bounds.north, s.max_top_height())};
}

// Corners of the bounding boxes of the objects over the table, u, up to as far above it as it is wide or
// deep.
std::vector<Eigen::Vector3d> corners_of_objects_over(const scene::SurfaceSpec&, const scene::Snapshot&,
                                                     const std::vector<scene::ObjectSpec>& catalogue);

}  // namespace smartsurf::view

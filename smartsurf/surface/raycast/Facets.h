// Faces of boxes and convex hulls in structure-of-arrays blocks, for SIMD ray casts.
#pragma once

#include <vector>

#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::surface {

// Eight planes. A point p is inside if x·px + y·py + z·pz ≤ offset; (x, y, z) is the outward unit normal in
// the object's frame, offset in u. Unused lanes have a zero normal and contain every point.
struct FacetBlock {
  static constexpr int kLanes = 8;
  float x[kLanes] = {}, y[kLanes] = {}, z[kLanes] = {};
  float offset[kLanes] = {1, 1, 1, 1, 1, 1, 1, 1};
};

// All faces of one convex hull.
using Facets = std::vector<FacetBlock>;

// A box or a solid as a union of convex hulls.
struct Polyhedron {
  const scene::Solid* solid;  // null for a box
  std::vector<Facets> hulls;  // convex
};
Polyhedron polyhedron_of(const scene::ObjectSpec&);

}  // namespace smartsurf::surface

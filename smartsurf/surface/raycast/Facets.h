// The faces of what is bounded by planes, side by side, for sensors that look at several at a time.
#pragma once

#include <vector>

#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::surface {

// Inside, x·px + y·py + z·pz ≤ offset; normals are unit vectors in the object's own axes. Lanes not in use
// have no normal, and every point inside.
struct FacetBlock {
  static constexpr int kLanes = 8;
  float x[kLanes] = {}, y[kLanes] = {}, z[kLanes] = {};
  float offset[kLanes] = {1, 1, 1, 1, 1, 1, 1, 1};
};

// All faces of one convex piece.
using Facets = std::vector<FacetBlock>;

// What planes bound: a box or a solid.
struct Polyhedron {
  const scene::Solid* solid;   // null: a box
  std::vector<Facets> pieces;  // convex
};
Polyhedron polyhedron_of(const scene::ObjectSpec&);

}  // namespace smartsurf::surface

// Decomposes a solid into approximately convex parts.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "smartsurf/mesh/TriangleMesh.h"

namespace smartsurf::mesh {

struct DecompositionLimits {
  int max_parts = 32;        // at most, ≥ 1
  double max_excess = 0.01;  // cut until the hulls together hold at most this share more than the solid
};

// For each part points with the same convex hull; ≥ 1. The mesh must be closed and face outwards.
// Deterministic.
//
// The part whose hull exceeds it the most is cut by the plane that makes the two hulls smallest, among the
// planes of the faces beside the mesh's concave edges (which cut parts made of flat faces exactly) and evenly
// spaced ones across its axes (which cut round ones); at last, neighbours whose common hull is no larger are
// joined. A greedy search, as in K. Mamou, "Volumetric hierarchical approximate convex decomposition" (Game
// Engine Gems 3, 2016), but with exact cuts of the surface instead of voxels.
std::vector<std::vector<Eigen::Vector3d>> decompose_convex(const TriangleMesh&, const DecompositionLimits&);

}  // namespace smartsurf::mesh

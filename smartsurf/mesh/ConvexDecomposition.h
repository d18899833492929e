// Decomposes a solid into approximately convex parts by a greedy search with exact plane cuts.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "smartsurf/mesh/TriangleMesh.h"

namespace smartsurf::mesh {

// A mesh of more triangles is decomposed in a simplified form, which bounds the time.
inline constexpr std::size_t kMaxDecomposedTriangles = 5000;

struct DecompositionLimits {
  int max_parts = 32;        // ≥ 1
  double max_excess = 0.01;  // allowed total volume of the hulls beyond the solid, relative to the solid's
  int max_hollow_parts = 1;  // where max_parts, if that is more, leave an excess above a tenth
};

// Returns at least one part, each as points with the same convex hull as the part. The mesh must be closed
// and oriented outwards. Deterministic.
//
// Each step cuts the part with the largest excess of hull volume over volume. It chooses the plane with the
// smallest total hull volume among the planes of the faces at concave edges (exact for flat-faced parts) and
// evenly spaced planes along the axes (for round parts). Finally, parts are merged while their common hull is
// not much larger. The greedy search follows K. Mamou, "Volumetric hierarchical approximate convex
// decomposition" (Game Engine Gems 3, 2016), but cuts the surface exactly instead of using voxels.
//
// A hollow solid such as a mug, of which these parts exceed it by more than a tenth, is decomposed again:
// shells outside each other apart, and each part halved across the principal axes of its surface, which turns
// walls into short arcs.
std::vector<std::vector<Eigen::Vector3d>> decompose_convex(const TriangleMesh&, const DecompositionLimits&);

}  // namespace smartsurf::mesh

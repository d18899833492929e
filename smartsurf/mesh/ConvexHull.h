// The convex hull of points, by Quickhull (C. B. Barber, D. P. Dobkin, H. Huhdanpaa, "The Quickhull algorithm
// for convex hulls", ACM Trans. Math. Softw. 22, 1996) in the library Qhull. Deterministic.
#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <span>
#include <vector>

#include "smartsurf/scene/Solid.h"

namespace smartsurf::mesh {

// The most corners of a piece: every contact and every ray looks at them. A hull with more is replaced by one
// through this many of its corners, spread over all directions.
inline constexpr std::size_t kMaxHullCorners = 256;

// None when the points have no volume (all in one plane, to about a millionth of their extent) or are fewer
// than four. Coplanar faces are one polygon. Every corner is one of the points.
std::optional<scene::ConvexHull> convex_hull(std::span<const Eigen::Vector3f> points);

// The volume of the hull, u³; 0 where convex_hull gives none.
double hull_volume(std::span<const Eigen::Vector3d> points);

}  // namespace smartsurf::mesh

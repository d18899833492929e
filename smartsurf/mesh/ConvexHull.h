// Computes the convex hull of points with the library Qhull (C. B. Barber, D. P. Dobkin, H. Huhdanpaa, "The
// Quickhull algorithm for convex hulls", ACM Trans. Math. Softw. 22, 1996). Deterministic.
#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <span>
#include <vector>

#include "smartsurf/scene/Solid.h"

namespace smartsurf::mesh {

// The maximum number of vertices of a hull, which bounds the cost of contacts and rays. A larger hull is
// replaced by the hull of at most this many of its vertices, spread over all directions.
inline constexpr std::size_t kMaxHullCorners = 256;

// Nullopt for fewer than four points, or points that are coplanar to about 1e-6 of their extent. Coplanar
// faces are merged into one polygon. All vertices are input points.
std::optional<scene::ConvexHull> convex_hull(std::span<const Eigen::Vector3f> points);

// The volume of the hull, u³; 0 for points without a hull.
double hull_volume(std::span<const Eigen::Vector3d> points);

}  // namespace smartsurf::mesh

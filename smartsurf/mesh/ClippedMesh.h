// A solid clipped by a set of planes, for convex decomposition.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <vector>

#include "smartsurf/mesh/TriangleMesh.h"

namespace smartsurf::mesh {

struct Plane {
  Eigen::Vector3d normal;  // unit
  double offset = 0.0;     // normal · x < offset below the plane

  double signed_distance(const Eigen::Vector3d& p) const { return normal.dot(p) - offset; }
  Plane flipped() const { return {-normal, -offset}; }
};

// The source mesh must be closed and outlive all ClippedMesh objects made from it. Points within 1e-7 of the
// source's extent from a plane are treated as lying on it.
class ClippedMesh {
 public:
  using Triangle = std::array<Eigen::Vector3d, 3>;

  explicit ClippedMesh(const TriangleMesh& source);

  ClippedMesh clip_below(const Plane&) const;

  double volume() const;
  // The rest of the source's surface, without the cuts.
  const std::vector<Triangle>& surface() const { return surface_; }
  // Points with the same convex hull as the clipped solid.
  std::vector<Eigen::Vector3d> hull_points() const;
  // Approximates clip_below(plane).hull_points() at lower cost. Samples a few thousand triangles of a fine
  // surface.
  std::vector<Eigen::Vector3d> hull_points_below(const Plane&) const;

 private:
  struct ClipResult;

  // Clips every stride-th triangle.
  ClipResult clip_triangles(const std::vector<Triangle>&, const Plane&, std::size_t stride = 1) const;
  std::vector<Eigen::Vector3d> interior_corners_below(const Plane&) const;
  bool is_inside_source(const Eigen::Vector3d&) const;

  const TriangleMesh* source_;
  Eigen::AlignedBox3d bounds_;  // of the source
  double snap_distance_;
  std::vector<Plane> planes_;
  std::vector<Triangle> surface_;  // the clipped surface of the source
  // Each cut is closed by a triangle fan from one point. The triangles of a non-convex cut overlap and
  // cancel: volumes are correct, but the vertices need not belong to the clipped solid.
  std::vector<Triangle> caps_;
  std::vector<Eigen::Vector3d> interior_corners_;  // intersections of three planes inside the source
};

}  // namespace smartsurf::mesh

// The part of a solid below a set of cutting planes.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "smartsurf/mesh/TriangleMesh.h"

namespace smartsurf::mesh {

struct Plane {
  Eigen::Vector3d normal;  // unit
  double offset = 0.0;     // below: normal · x < offset

  double signed_distance(const Eigen::Vector3d& p) const { return normal.dot(p) - offset; }
  Plane flipped() const { return {-normal, -offset}; }
};

// The whole must outlive its parts. Points nearer to a plane than a ten-millionth of the whole's extent lie
// on it.
class ClippedMesh {
 public:
  explicit ClippedMesh(const TriangleMesh& source);

  ClippedMesh clip_below(const Plane&) const;

  double volume() const;
  // Points whose convex hull is that of the part.
  std::vector<Eigen::Vector3d> hull_points() const;
  // points() of below(), without making it; of a fine surface only a few thousand triangles are looked at.
  std::vector<Eigen::Vector3d> hull_points_below(const Plane&) const;

 private:
  using Triangle = std::array<Eigen::Vector3d, 3>;
  struct ClipResult;

  // Looks at every stride-th triangle.
  ClipResult clip_triangles(const std::vector<Triangle>&, const Plane&, std::size_t stride = 1) const;
  std::vector<Eigen::Vector3d> interior_corners_below(const Plane&) const;
  bool is_inside_source(const Eigen::Vector3d&) const;

  const TriangleMesh* source_;
  Eigen::Vector3d low_, high_;  // bounds of the whole
  double snap_distance_;
  std::vector<Plane> planes_;
  std::vector<Triangle> surface_;  // what of the solid's surface bounds the part
  // Closes the surface over each cut by a fan from one point. Where a cut is not convex, triangles of a fan
  // overlap and cancel: right for volumes, wrong as a picture, and their points need not be the part's.
  std::vector<Triangle> caps_;
  std::vector<Eigen::Vector3d> interior_corners_;  // where three planes meet inside the solid
};

}  // namespace smartsurf::mesh

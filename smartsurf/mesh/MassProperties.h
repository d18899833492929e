// Computes volume, centre of mass and inertia of a closed polyhedron, exact except for rounding.
//
// Sums the integrals of 1, x and x·xᵀ over the signed tetrahedra that the triangles span with the origin (B.
// Mirtich, "Fast and accurate computation of polyhedral mass properties", J. Graphics Tools 1(2), 1996; D.
// Eberly, "Polyhedral mass properties (revisited)", 2002).
#pragma once

#include <Eigen/Core>
#include <span>

#include "smartsurf/mesh/TriangleMesh.h"
#include "smartsurf/scene/Solid.h"

namespace smartsurf::mesh {

class MassProperties {
 public:
  // Triangles are counter-clockwise seen from outside. Keep the origin near them to reduce rounding errors.
  void add(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c);
  void add(const TriangleMesh&);
  void add(const scene::ConvexHull&);

  double volume() const { return volume_; }
  Eigen::Vector3d centre() const { return first_moment_ / volume_; }
  // The inertia tensor about a point, for density 1.
  Eigen::Matrix3d inertia(const Eigen::Vector3d& about) const;

 private:
  double volume_ = 0.0;
  Eigen::Vector3d first_moment_ = Eigen::Vector3d::Zero();   // ∫ x dV
  Eigen::Matrix3d second_moment_ = Eigen::Matrix3d::Zero();  // ∫ x·xᵀ dV
};

}  // namespace smartsurf::mesh

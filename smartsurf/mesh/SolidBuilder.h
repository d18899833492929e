// Builds a scene::Solid from a mesh or points: convex hulls, mass properties and frame.
#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "smartsurf/mesh/TriangleMesh.h"
#include "smartsurf/scene/Solid.h"

namespace smartsurf::mesh {

struct SolidOptions {
  bool decompose = true;
  int pieces = 32;         // at most
  double tolerance = 0.2;  // share by which the pieces may differ from the mesh
};

// `mesh`: as read from a file, in u. Both throw scene::InputError, one clause, when no solid can be made;
// `notes` gets a clause for each thing that was mended, or that its author should know.
scene::Solid build_solid(TriangleMesh mesh, const SolidOptions&, std::vector<std::string>& notes);
scene::Solid build_hull_solid(std::span<const Eigen::Vector3d> points);

}  // namespace smartsurf::mesh

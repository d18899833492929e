// Builds a scene::Solid from a mesh or points: convex hulls, mass properties and body frame.
#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "smartsurf/mesh/TriangleMesh.h"
#include "smartsurf/scene/Solid.h"

namespace smartsurf::mesh {

class DecompositionCache;

struct SolidOptions {
  bool decompose = true;
  int max_hulls = 32;        // of the decomposition
  int max_hollow_hulls = 1;  // if that is more, and max_hulls leave an excess above a tenth
  double tolerance = 0.2;    // allowed relative deviation of the hulls' volume and inertia from the mesh's
  const DecompositionCache* cache = nullptr;
};

// `mesh` is as read from a file, scaled to u. Appends a clause to `notes` for each repair and each notable
// deviation. All functions throw scene::InputError, one clause, if no solid can be built.
scene::Solid build_solid(TriangleMesh mesh, const SolidOptions&, std::vector<std::string>& notes);
scene::Solid build_hull_solid(std::span<const Eigen::Vector3d> points);
// The union of the convex hulls of the parts; where they overlap, volume and inertia count twice.
scene::Solid build_compound(std::span<const std::vector<Eigen::Vector3d>> parts);

}  // namespace smartsurf::mesh

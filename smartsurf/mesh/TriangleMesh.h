// An indexed triangle mesh, with the checks and repairs that make it the closed, outward-oriented boundary of
// a solid.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace smartsurf::mesh {

struct TriangleMesh {
  std::vector<Eigen::Vector3d> points;
  std::vector<std::array<std::uint32_t, 3>> triangles;  // counter-clockwise seen from outside
};

Eigen::AlignedBox3d bounding_box(const TriangleMesh&);
// The length of its diagonal; 0 without points.
double bounding_box_diagonal(const TriangleMesh&);

// Merges points within `distance` of each other, transitively. Removes triangles that become degenerate,
// duplicate triangles and unused points.
void weld_points(TriangleMesh&, double distance);

// Flips triangles so that every shell faces outwards and every cavity inwards. Returns one clause per repair.
// Throws scene::InputError, one clause, if the mesh is open or its inside is ambiguous.
std::vector<std::string> orient_shells(TriangleMesh&);

// The generalized winding number of a point: 1 inside, 0 outside, in between on the surface.
double winding_number(const TriangleMesh&, const Eigen::Vector3d&);

}  // namespace smartsurf::mesh

// An indexed triangle mesh, and the checks and repairs before it can bound a solid: closed, oriented
// outwards.
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

// Length of the diagonal of the box around the points; 0 without points.
double bounding_box_diagonal(const TriangleMesh&);

// Makes one point of those that are less than `distance` apart (in chains, too), drops triangles that lose an
// edge by it, repeated triangles, and points without a triangle.
void weld_points(TriangleMesh&, double distance);

// Turns triangles until every shell faces outwards, and cavities inwards. Returns what it had to turn, a
// clause each. Throws scene::InputError, one clause, when edges are open, or meet so that no inside can be
// told.
std::vector<std::string> orient_shells(TriangleMesh&);

// How often the triangles wind around a point: 1 inside, 0 outside, in between on the surface.
double winding_number(const TriangleMesh&, const Eigen::Vector3d&);

}  // namespace smartsurf::mesh

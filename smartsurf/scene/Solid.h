// A body bounded by flat faces: the triangles that are drawn, and the convex hulls used by collision and
// sensors.
//
// All points are in the body frame: its origin is the centre of mass, its axes are those of the file or
// description (not the principal axes), lengths in u.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace smartsurf::scene {

// One convex polyhedron. Faces are polygons, counter-clockwise seen from outside; each edge is listed once.
struct ConvexHull {
  struct Face {
    Eigen::Vector3f normal{0, 0, 1};  // unit, outward
    float offset = 0.0F;              // normal · x = offset on the face
    std::uint32_t first_vertex = 0;   // its corners are face_corners[first .. first + count)
    std::uint32_t vertex_count = 0;
  };
  std::vector<Eigen::Vector3f> vertices;
  std::vector<Face> faces;
  std::vector<std::uint16_t> face_vertices;
  std::vector<std::array<std::uint16_t, 2>> edges;
  Eigen::Vector3f bounds_min{0, 0, 0}, bounds_max{0, 0, 0};  // bounds
  // Parallel faces or edges once: the directions to try for a separating axis.
  std::vector<Eigen::Vector3f> unique_normals, unique_edge_directions;
};

// The piece with these corners and faces: `loops` holds the corners of each face in turn, counter-clockwise
// seen from outside, `sizes` how many each face has (≥ 3). Normals, offsets, edges, bounds and directions
// follow from them, so that the same corners and faces give the same piece to the bit. The faces must be
// those of a convex polyhedron.
ConvexHull make_convex_hull(std::vector<Eigen::Vector3f> vertices, std::vector<std::uint16_t> face_loops,
                            std::span<const std::uint32_t> face_sizes);

struct Solid {
  std::string source;  // the file it was read from, or what made it ("cone")
  std::vector<Eigen::Vector3f> vertices;
  std::vector<std::array<std::uint32_t, 3>> triangles;       // counter-clockwise seen from outside
  std::vector<ConvexHull> hulls;                             // ≥ 1; together they fill the solid
  double volume = 0.0;                                       // u³
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();         // about the centre of mass, for density 1
  Eigen::Vector3f bounds_min{0, 0, 0}, bounds_max{0, 0, 0};  // bounds
  float bounding_radius = 0.0F;                              // the farthest point's distance from the origin
};

// Sets low, high and reach to those of the vertices (≥ 1).
void compute_bounds(Solid&);

}  // namespace smartsurf::scene

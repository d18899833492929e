// A polyhedral body: triangles for drawing, and convex hulls for collision and sensors.
//
// All points are in the body frame. Its origin is the centre of mass, its axes are those of the source file
// or description (not the principal axes), lengths are in u.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace smartsurf::scene {

inline constexpr int kMaxHulls = 256;  // of one solid

// A convex polyhedron: one of those whose union is a solid. Scripts call it a piece of a mesh (`pieces` is
// the most that a mesh may have) or a part of a hull (`parts`). Faces are polygons, counter-clockwise seen
// from outside.
struct ConvexHull {
  struct Face {
    Eigen::Vector3f normal{0, 0, 1};  // unit, outward
    float offset = 0.0F;              // normal · x = offset on the face
    std::uint32_t first_vertex = 0;   // index into face_vertices
    std::uint32_t vertex_count = 0;
  };
  std::vector<Eigen::Vector3f> vertices;
  std::vector<Face> faces;
  std::vector<std::uint16_t> face_vertices;         // indices into vertices, face by face
  std::vector<std::array<std::uint16_t, 2>> edges;  // each edge once
  Eigen::Vector3f bounds_min{0, 0, 0}, bounds_max{0, 0, 0};
  // Directions without parallel duplicates, for the separating-axis test.
  std::vector<Eigen::Vector3f> unique_normals, unique_edge_directions;
};

// Builds a hull from its vertices and faces. `face_loops` lists the vertex indices of one face after the
// other, counter-clockwise seen from outside; `face_sizes` has the vertex count (≥ 3) of each face. All other
// members are derived from these, so that equal arguments give bit-identical hulls. The faces must form a
// convex polyhedron.
ConvexHull make_convex_hull(std::vector<Eigen::Vector3f> vertices, std::vector<std::uint16_t> face_loops,
                            std::span<const std::uint32_t> face_sizes);
// The hull with other corners, one for each of its own, which form the same faces.
ConvexHull with_vertices(const ConvexHull&, std::vector<Eigen::Vector3f> vertices);

struct Solid {
  std::string source;  // the mesh file, or the generator ("cone")
  std::vector<Eigen::Vector3f> vertices;
  std::vector<std::array<std::uint32_t, 3>> triangles;  // counter-clockwise seen from outside
  std::vector<ConvexHull> hulls;                        // ≥ 1; their union approximates the solid
  Eigen::Vector3d centroid{0, 0, 0};  // of the source, in its own coordinates, u: the origin here
  double volume = 0.0;                // u³
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();  // about the centre of mass, for density 1
  Eigen::Vector3f bounds_min{0, 0, 0}, bounds_max{0, 0, 0};
  float bounding_radius = 0.0F;  // distance of the farthest vertex from the origin
};

// Sets bounds_min, bounds_max and bounding_radius from the vertices, of which there is at least one.
void compute_bounds(Solid&);
// The solid made larger by the factor, > 0: what is derived from its points is that of the larger ones.
Solid scaled(const Solid&, double factor);

}  // namespace smartsurf::scene

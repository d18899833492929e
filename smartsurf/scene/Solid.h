// A body bounded by flat faces: the triangles that are seen, and the convex pieces that collide and are sensed.
//
// All points are in the body's own frame: its origin is the centre of mass, its axes are those of the file or the
// description it came from (not turned to the principal axes), lengths in u.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace smartsurf::scene {

// One convex polyhedron. Faces are polygons, counter-clockwise seen from outside; each edge is listed once.
struct ConvexPiece {
  struct Face {
    Eigen::Vector3f normal;         // unit, outward
    float offset = 0.0F;            // normal · x = offset on the face
    std::uint32_t first = 0;        // its corners are face_corners[first .. first + count)
    std::uint32_t count = 0;
  };
  std::vector<Eigen::Vector3f> corners;
  std::vector<Face> faces;
  std::vector<std::uint16_t> face_corners;
  std::vector<std::array<std::uint16_t, 2>> edges;
  Eigen::Vector3f low, high;  // bounds
  // Parallel faces or edges once: the directions to try for a separating axis.
  std::vector<Eigen::Vector3f> face_normals, edge_directions;
};

struct Solid {
  std::string source;  // the file it was read from, or what made it ("cone")
  std::vector<Eigen::Vector3f> vertices;
  std::vector<std::array<std::uint32_t, 3>> triangles;  // counter-clockwise seen from outside
  std::vector<ConvexPiece> pieces;                      // ≥ 1; together they fill the solid
  double volume = 0.0;                                  // u³
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();    // about the centre of mass, for density 1
  Eigen::Vector3f low, high;                            // bounds
  float reach = 0.0F;                                   // the farthest point's distance from the origin
};

}  // namespace smartsurf::scene

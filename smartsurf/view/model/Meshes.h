// Triangle meshes and wireframes of the object shapes, for instanced drawing. No OpenGL.
//
// Box, cylinder and cone have half extents of 1 and are scaled by the instance's half extents; the origin of
// a cone is its centre of mass. A capsule is a unit sphere: the sign of a vertex's z assigns it to the upper
// or the lower cap, and the vertex shader moves the caps apart. A solid keeps its own size.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "smartsurf/scene/Solid.h"

namespace smartsurf::view {

struct Mesh {
  std::vector<float> vertices;         // 6 per vertex: position, normal
  std::vector<std::uint32_t> indices;  // 3 per triangle, counter-clockwise from outside

  // Returns the new vertex's index.
  std::uint32_t add_vertex(float x, float y, float z, float nx, float ny, float nz);
  void add_triangle(std::uint32_t a, std::uint32_t b, std::uint32_t c);
};

// The point of a unit circle after that share of a turn from +x.
std::array<float, 2> circle_point(int step, int steps);

Mesh box_mesh();
// segments: number of segments around the z axis.
Mesh cylinder_mesh(int segments);
Mesh cone_mesh(int segments);
Mesh capsule_mesh(int segments);
Mesh solid_mesh(const scene::Solid& solid);  // flat-shaded: no shared vertices

// Line segments: two end points x y z each.
std::vector<float> sphere_wireframe();
std::vector<float> box_wireframe();
std::vector<float> cylinder_wireframe();
std::vector<float> cone_wireframe();
std::vector<float> capsule_wireframe();
// The edges between non-coplanar faces.
std::vector<float> solid_wireframe(const scene::Solid& solid);

}  // namespace smartsurf::view

// Triangles and wires of the shapes, to be drawn once an instance. No OpenGL here.
//
// Box, cylinder and cone are given for half extents of 1 in every direction and scaled by the instance's (a
// cone's origin is its centre of mass, which its box of half extents is centred on). A capsule is given as a
// sphere of radius 1 whose corners, by the sign of their z, belong to the upper or the lower cap: drawing
// pulls the caps apart. A solid keeps its own size.
#pragma once

#include <cstdint>
#include <vector>

#include "smartsurf/scene/Solid.h"

namespace smartsurf::view {

struct Mesh {
  std::vector<float> vertices;         // x y z, and the normal's x y z, a corner
  std::vector<std::uint32_t> indices;  // three corners each

  std::uint32_t add_vertex(float x, float y, float z, float nx, float ny, float nz);
  void add_triangle(std::uint32_t a, std::uint32_t b, std::uint32_t c);
};

Mesh box_mesh();
// segments: around; the more, the rounder.
Mesh cylinder_mesh(int segments);
Mesh cone_mesh(int segments);
Mesh capsule_mesh(int segments);
Mesh solid_mesh(const scene::Solid& solid);  // every face flat

// Ends of straight lines, two corners x y z a line.
std::vector<float> sphere_wireframe();
std::vector<float> box_wireframe();
std::vector<float> cylinder_wireframe();
std::vector<float> cone_wireframe();
std::vector<float> capsule_wireframe();
std::vector<float> solid_wireframe(
    const scene::Solid& solid);  // the edges between faces that do not lie in one plane

}  // namespace smartsurf::view

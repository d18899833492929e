// The GLSL sources (OpenGL 3.3 core), one function a program. Internal to the room.
#pragma once

#include <string>

namespace smartsurf::view {

// Which picture a program draws, and how carefully.
enum class Pass {
  kShadow,      // depth only, from the light
  kColourFast,  // pins and spheres lit by their corners: for a window without a graphics card
  kColour,      // lit, one shadow sample a pixel
  kColourFine   // lit, soft shadows
};

struct ShaderSources {
  std::string vertex, fragment;
};

// closed: gaps between pins of one level are painted on them instead of left open.
ShaderSources pin_shaders(Pass pass, bool closed = false);
ShaderSources sphere_shaders(Pass pass);  // a ray meets a sphere at every pixel of a quad that faces the eye
// Triangles and wires of Meshes.h. capsule: its caps are pulled apart.
ShaderSources mesh_shaders(Pass pass, bool capsule);
ShaderSources wire_shaders(bool capsule);
ShaderSources part_shaders(Pass pass);  // meshes of two colours, MechanismParts.h
ShaderSources line_shaders();           // straight lines as ribbons that face the eye
// shaded: with the sun's shadows.
ShaderSources ground_shaders(Pass pass, bool shaded);
ShaderSources backdrop_shaders();
// Averages blocks of `block` × `block` pixels of the texture at unit 1.
ShaderSources average_shaders();

}  // namespace smartsurf::view

// The GLSL sources (OpenGL 3.3 core), one function per program. Internal to this module.
#pragma once

#include <string>

namespace smartsurf::view {

// Which picture a program draws, and how carefully.
enum class RenderPass {
  kShadow,      // depth only, from the light
  kColourFast,  // pins and spheres lit by their corners: for a window without a graphics card
  kColour,      // lit, one shadow sample a pixel
  kColourFine   // lit, soft shadows
};

struct ShaderSources {
  std::string vertex, fragment;
};

// closed: gaps between pins of one level are painted on them instead of left open.
ShaderSources pin_shaders(RenderPass pass, bool closed = false);
ShaderSources sphere_shaders(
    RenderPass pass);  // a ray meets a sphere at every pixel of a quad that faces the eye
// Triangles and wires of Meshes.h. capsule: its caps are pulled apart.
ShaderSources mesh_shaders(RenderPass pass, bool capsule);
ShaderSources wireframe_shaders(bool capsule);
ShaderSources two_colour_mesh_shaders(RenderPass pass);  // meshes of two colours, ActuatorGeometry.h
ShaderSources line_shaders();                            // straight lines as ribbons that face the eye
// shaded: with the sun's shadows.
ShaderSources ground_shaders(RenderPass pass, bool shadowed);
ShaderSources backdrop_shaders();
// Averages blocks of `block` × `block` pixels of the texture at unit 1.
ShaderSources downsample_shaders();

}  // namespace smartsurf::view

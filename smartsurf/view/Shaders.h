// The GLSL sources (OpenGL 3.3 core), one function a program. Internal to the room.
#pragma once

#include <string>

namespace smartsurf::view {

// Which picture a program draws, and how carefully.
enum class Pass {
  kShadow,     // depth only, from the light
  kColour,     // lit, one shadow sample: for a window without a graphics card
  kColourFine  // lit, soft shadows
};

struct ShaderSources {
  std::string vertex, fragment;
};

ShaderSources pin_shaders(Pass pass);
ShaderSources sphere_shaders(Pass pass);  // a ray meets a sphere at every pixel of a quad that faces the eye
ShaderSources mesh_shaders(Pass pass);    // boxes and cylinders
ShaderSources wire_shaders();
ShaderSources ground_shaders(Pass pass);
ShaderSources backdrop_shaders();
// Averages blocks of `block` × `block` pixels of the texture at unit 1.
ShaderSources average_shaders();

}  // namespace smartsurf::view

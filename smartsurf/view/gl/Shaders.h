// The GLSL sources (OpenGL 3.3 core), one function per program. Internal to smartsurf/view.
#pragma once

#include <string>

#include "smartsurf/view/gl/RenderPass.h"

namespace smartsurf::view {

struct ShaderSources {
  std::string vertex, fragment;
};

// closed: gaps between level pins are painted on the pins instead of left open.
ShaderSources pin_shaders(RenderPass pass, bool closed = false);
// Sphere impostors: a ray–sphere intersection per fragment of a disc that faces the eye.
ShaderSources sphere_shaders(RenderPass pass);
// Meshes and wireframes of Meshes.h. capsule: the caps are moved apart.
ShaderSources mesh_shaders(RenderPass pass, bool capsule);
ShaderSources wireframe_shaders(bool capsule);
// The meshes of ActuatorGeometry.h.
ShaderSources two_colour_mesh_shaders(RenderPass pass);
// Straight lines as ribbons that face the eye.
ShaderSources line_shaders();
// shadowed: with the shadow map and the table's ambient occlusion.
ShaderSources ground_shaders(RenderPass pass, bool shadowed);
ShaderSources backdrop_shaders();
// Ambient occlusion of each pixel by what the depths of its surroundings show: visibility and distance.
ShaderSources occlusion_shaders();
// Averages blocks of `block` × `block` samples (supersampling), darkened by the occlusion.
ShaderSources resolve_shaders();

}  // namespace smartsurf::view

// GLSL chunks shared by several shaders. Internal to this module.
#pragma once

#include <string>

#include "smartsurf/view/gl/Shaders.h"

namespace smartsurf::view {

// Version, defines of the pass and the frame's uniforms: every source begins with it. FINE: soft shadows;
// FAST: as little a pixel as can be.
std::string shader_preamble(RenderPass pass);

// lit(), lit_glossy() and what they need; linear light in, screen colours out.
extern const char* const kLighting;

// An object's instance, and where its mesh's corners are.
extern const char* const kObjectAttributes;

// How much of the sky an object's surface sees from inside a pocket whose rim is at z = rim.
extern const char* const kPocketOcclusion;

extern const char* const kEmptyFragment;

}  // namespace smartsurf::view

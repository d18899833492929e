// GLSL chunks shared by several shaders. Internal to smartsurf/view.
#pragma once

#include <string>

#include "smartsurf/view/gl/RenderPass.h"

namespace smartsurf::view {

// The start of every shader: version, uniform block `Frame` and the define of the pass. FINE: soft shadows.
// FAST: minimal work per fragment.
std::string shader_preamble(RenderPass pass);

// lit(), lit_material() and their helpers: linear light in, screen colours out.
extern const char* const kLighting;

// The instance attributes of an object, rotate() and placed().
extern const char* const kObjectAttributes;

// pocket_sky(): share of the sky visible from a point of an object in a pocket whose rim is at z = rim.
extern const char* const kPocketOcclusion;

extern const char* const kEmptyFragment;

}  // namespace smartsurf::view

// The pass that a shader program draws, and its shading quality. Internal to smartsurf/view.
#pragma once

namespace smartsurf::view {

enum class RenderPass {
  kShadow,      // depth only, from the light
  kColourFast,  // pins lit per vertex, simplified spheres; for software renderers
  kColour,      // lit per fragment, one shadow sample
  kColourFine   // lit per fragment, soft shadows
};

}  // namespace smartsurf::view

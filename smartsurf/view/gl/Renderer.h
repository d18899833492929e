// Draws one snapshot with OpenGL 3.3 core into a framebuffer. Private to the view: callers use OffscreenView
// or Window.
//
// A context must be current, the same one, in every call; not thread-safe. draw() allocates only when the
// number of objects or the size of the picture grows.
#pragma once

#include <functional>
#include <memory>
#include <string_view>
#include <vector>

#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/scene/Snapshot.h"
#include "smartsurf/view/gl/Shaders.h"
#include "smartsurf/view/model/Camera.h"
#include "smartsurf/view/model/DrawOptions.h"

namespace smartsurf::view {

struct RenderQuality {
  int supersample = 1;  // pixels drawn along each edge of a pixel shown
  int shadow_map_size = 2048;
  RenderPass colour_pass = RenderPass::kColour;
  int frames_per_shadow_update = 1;  // shadows are drawn anew every so many frames

  static RenderQuality fast() {
    return {1, 1024, RenderPass::kColourFast, 2};
  }  // a window without a graphics card
  static RenderQuality gpu() { return {2, 4096, RenderPass::kColourFine}; }  // and with one
  static RenderQuality video() { return {2, 2048, RenderPass::kColour}; }
  static RenderQuality fine() { return {3, 4096, RenderPass::kColourFine}; }
};

class Renderer {
 public:
  // Throws std::runtime_error when the context cannot do what is needed.
  Renderer(const scene::SceneSpec& spec, const RenderQuality& quality);
  ~Renderer();

  // catalogue: every object ever made, index = object id. width, height: of the framebuffer, pixels.
  void draw(const scene::Snapshot& snapshot, const std::vector<scene::ObjectSpec>& catalogue,
            const Camera& camera, const DrawOptions& options, unsigned framebuffer, int width, int height);

  // For measurements: from now on every draw() calls it with the name of each stage that it has handed to the
  // driver.
  using StageCallback = std::function<void(std::string_view stage)>;
  void set_stage_callback(StageCallback callback);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace smartsurf::view

// Draws a snapshot into a framebuffer with OpenGL 3.3 core. Internal to smartsurf/view: callers use
// OffscreenView or Window.
//
// The same OpenGL context must be current in every call. Not thread-safe. draw() allocates only when the
// number of objects or the image size grows.
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
  int supersample = 1;  // samples along each edge of an output pixel
  int shadow_map_size = 2048;
  RenderPass colour_pass = RenderPass::kColour;
  int frames_per_shadow_update = 1;  // the shadow map is redrawn every n-th frame
  // Ambient occlusion between all that is drawn, not only above pins. Needs supersample > 1.
  bool occlusion = false;

  // A window on a software renderer.
  static RenderQuality fast() { return {1, 1024, RenderPass::kColourFast, 2}; }
  // Many small images on a software renderer, each a function of its snapshot alone.
  static RenderQuality preview() { return {1, 768, RenderPass::kColourFast}; }
  // The same with smooth edges.
  static RenderQuality smooth() { return {2, 768, RenderPass::kColourFast}; }
  // A window on a GPU.
  static RenderQuality gpu() { return {2, 4096, RenderPass::kColourFine, 1, true}; }
  static RenderQuality video() { return {2, 2048, RenderPass::kColour, 1, true}; }
  // Still images.
  static RenderQuality fine() { return {3, 4096, RenderPass::kColourFine, 1, true}; }
};

class Renderer {
 public:
  // Throws std::runtime_error if the context does not support OpenGL 3.3 or a shader fails to compile.
  Renderer(const scene::SceneSpec& spec, const RenderQuality& quality);
  ~Renderer();

  // Draws the snapshot into `framebuffer`, width × height pixels. catalogue: every object ever created,
  // index = object id.
  void draw(const scene::Snapshot& snapshot, const std::vector<scene::ObjectSpec>& catalogue,
            const Camera& camera, const DrawOptions& options, unsigned framebuffer, int width, int height);

  // A hook for profiling: draw() calls `callback` with the name of each stage once its commands are
  // submitted.
  using StageCallback = std::function<void(std::string_view stage)>;
  void set_stage_callback(StageCallback callback);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace smartsurf::view

// Draws one snapshot with OpenGL 3.3 core into a framebuffer. Internal to the room: callers use OffscreenView
// or Window.
//
// A context must be current, the same one, in every call; not thread-safe. draw() allocates only when the
// number of objects or the size of the picture grows.
#pragma once

#include <memory>
#include <vector>

#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/scene/Snapshot.h"
#include "smartsurf/view/Camera.h"
#include "smartsurf/view/DrawOptions.h"

namespace smartsurf::view {

struct Quality {
  int supersample = 1;  // pixels drawn along each edge of a pixel shown
  int shadow_size = 2048;
  bool soft_shadows = false;
  int frames_a_shadow = 1;  // shadows are drawn anew every so many frames

  static Quality fast() { return {1, 1024, false, 2}; }
  static Quality video() { return {2, 2048, false}; }
  static Quality fine() { return {3, 4096, true}; }
};

class Renderer {
 public:
  // Throws std::runtime_error when the context cannot do what is needed.
  Renderer(const scene::SceneSpec& spec, const Quality& quality);
  ~Renderer();

  // catalogue: every object ever made, index = object id. width, height: of the framebuffer, pixels.
  void draw(const scene::Snapshot& snapshot, const std::vector<scene::ObjectSpec>& catalogue,
            const Camera& camera, const DrawOptions& options, unsigned framebuffer, int width, int height);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace smartsurf::view

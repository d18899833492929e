// Renders pictures off-screen, through EGL into memory.
//
// The same snapshot, camera, options and size give the same bytes on the same driver. One thread at a time,
// any thread; leaves no context current, so that it can coexist with a Window.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "common/image/Image.h"
#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/scene/Snapshot.h"
#include "smartsurf/view/model/Camera.h"
#include "smartsurf/view/model/DrawOptions.h"

namespace smartsurf::view {

// kPicture: the finest there is, about a second a picture without a graphics card. kVideo: a tenth of that.
enum class Detail { kStill, kVideo };

class OffscreenView {
 public:
  // Throws scene::InputError, one line, in a build without the view: asked before a run, so that it fails at
  // once.
  static void require_available();

  // Throws std::runtime_error, one line that names the packages, when this machine has no OpenGL 3.3.
  explicit OffscreenView(const scene::SceneSpec& spec, Detail detail = Detail::kStill);
  ~OffscreenView();

  // catalogue: every object ever made, index = object id. width, height: 1 to 8192 pixels; beyond that, or
  // where the driver draws no picture so large, throws scene::InputError.
  common::Image render(const scene::Snapshot& snapshot, const std::vector<scene::ObjectSpec>& catalogue,
                       const Camera& camera, const DrawOptions& options, int width, int height);

  // The driver's name for itself, for logs.
  std::string driver_name() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

// One picture, by an OffscreenView of its own: for a series make one and keep it.
common::Image render_image(const scene::SceneSpec& spec, const scene::Snapshot& snapshot,
                           const std::vector<scene::ObjectSpec>& catalogue, const Camera& camera,
                           const DrawOptions& options, int width, int height);

}  // namespace smartsurf::view

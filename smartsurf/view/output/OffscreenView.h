// Renders images off-screen: through EGL, or by tracing paths on the processor.
//
// Identical snapshots, cameras, options and sizes give identical bytes on the same driver. Any thread, one at
// a time for each OffscreenView. No context stays current between calls, so one can coexist with others and a
// Window.
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

class OffscreenView {
 public:
  // Throws scene::InputError with a one-line message in a build without the view, or without Embree where the
  // detail needs it. Call it before a run, so that the run fails early.
  static void require_available(Detail detail = Detail::kStill);

  // Throws std::runtime_error with a one-line message that names the missing packages if OpenGL 3.3 is not
  // available.
  explicit OffscreenView(const scene::SceneSpec& spec, Detail detail = Detail::kStill);
  ~OffscreenView();

  // Renders one image, row 0 at the top. catalogue: every object ever created, index = object id. Throws
  // scene::InputError if width or height is not 1 to 8192 pixels, and std::runtime_error if the driver
  // refuses the size.
  common::Image render(const scene::Snapshot& snapshot, const std::vector<scene::ObjectSpec>& catalogue,
                       const Camera& camera, const DrawOptions& options, int width, int height);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

// Renders one image with a temporary OffscreenView. For a series, keep an OffscreenView.
common::Image render_image(const scene::SceneSpec& spec, const scene::Snapshot& snapshot,
                           const std::vector<scene::ObjectSpec>& catalogue, const Camera& camera,
                           const DrawOptions& options, int width, int height);

}  // namespace smartsurf::view

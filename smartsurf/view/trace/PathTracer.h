// Path tracing on the processor: the scene, camera and light of the OpenGL renderer, with the light that
// surfaces cast on each other.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "common/image/Image.h"
#include "smartsurf/view/trace/TraceScene.h"

namespace smartsurf::view {

struct TraceSettings {
  int samples = 32;       // paths per pixel
  double aperture = 0.0;  // diameter of the lens, u; 0: everything is sharp
  int threads = 1;        // changes no result
};

// Radiance and the share of each pixel that is not background; row-major, row 0 at the top.
struct TracedImage {
  int width = 0, height = 0;
  std::vector<Eigen::Vector3f> radiance;  // of the share alone
  std::vector<float> coverage;
};

// Khronos' PBR Neutral, and the screen colour of linear light: as to_screen() in ShaderChunks.cpp.
Eigen::Vector3f to_screen(const Eigen::Vector3f& radiance);

class PathTracer {
 public:
  // Throws scene::InputError in a build without Embree.
  static void require_available();

  explicit PathTracer(const scene::SceneSpec& spec);
  ~PathTracer();

  TracedImage trace(const scene::Snapshot& snapshot, const std::vector<scene::ObjectSpec>& catalogue,
                    const Camera& camera, const DrawOptions& options, const StageLight& light,
                    const TraceSettings& settings, int width, int height);
  // Over the stage's background, as screen colours.
  common::Image render(const scene::Snapshot& snapshot, const std::vector<scene::ObjectSpec>& catalogue,
                       const Camera& camera, const DrawOptions& options, const TraceSettings& settings,
                       int width, int height);

 private:
  scene::SceneSpec spec_;
  TraceScene scene_;
};

}  // namespace smartsurf::view

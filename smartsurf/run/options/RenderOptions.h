// How pictures, videos and the window show the scene: --camera, --wires, --cells, --palette, --trails,
// --plot, --stage, --quality, --aperture, --samples and --picture-size.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/image/PixelSize.h"
#include "smartsurf/view/interaction/Controls.h"

namespace CLI {
class App;
}

namespace smartsurf::run {

struct RenderOptions {
  view::ViewSettings view;
  // The view.plots that --plot names without "metric:": the experiment must declare them.
  std::vector<std::string> plotted_metrics;
  std::optional<common::PixelSize> pixel_size;  // default: pictures 1600 × 1000, videos 1280 × 720
  // For path-traced pictures, as in view::DrawOptions.
  double aperture = 0.0;
  int samples = view::kDefaultSamples;
};

// The flags as given on the command line.
struct RenderFlags {
  std::string camera = "iso", cells, palette = "viridis", size, stage = "light", quality = "auto";
  bool wireframe = false;
  double trails_s = 0.0, aperture = 0.0;
  int samples = view::kDefaultSamples;
  std::vector<std::string> plots;
};

void add_render_flags(CLI::App& app, RenderFlags& flags);
// Throws scene::InputError if the camera, a signal or the size is invalid.
RenderOptions parse_render_options(const RenderFlags& flags);

}  // namespace smartsurf::run

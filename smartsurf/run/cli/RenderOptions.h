// How pictures and videos show the scene: --camera, --wires, --cells, --palette, --trails and --picture-size.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "common/image/PixelSize.h"
#include "smartsurf/view/interaction/Overlay.h"
#include "smartsurf/view/model/Camera.h"

namespace CLI {
class App;
}

namespace smartsurf::run {

struct RenderOptions {
  view::CameraPreset camera = view::CameraPreset::kIso;
  bool wireframe = false;
  view::OverlaySettings overlay;
  std::optional<common::PixelSize> pixel_size;  // default: pictures 1600 × 1000, videos 1280 × 720
};

// The flags as given on the command line.
struct RenderFlags {
  std::string camera = "iso", cells, palette = "viridis", size;
  bool wireframe = false;
  double trails_s = 0.0;
};

void add_render_flags(CLI::App& app, RenderFlags& flags);
// Throws scene::InputError if the size is invalid.
RenderOptions parse_render_options(const RenderFlags& flags);

}  // namespace smartsurf::run

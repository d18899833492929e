// How pictures and videos show the scene: what the flags --camera, --wires, --cells, --palette, --trails and
// --picture-size say.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "smartsurf/view/Camera.h"
#include "smartsurf/view/Overlay.h"

namespace CLI {
class App;
}

namespace smartsurf::run {

// In pixels.
struct PictureSize {
  int width, height;
};

struct Look {
  view::Preset camera = view::Preset::kIso;
  bool wires = false;
  view::OverlaySettings overlay;
  std::optional<PictureSize> size;  // none: of pictures 1600 x 1000, of videos 1280 x 720
};

// The flags as typed.
struct LookFlags {
  std::string camera = "iso", cells, palette = "viridis", size;
  bool wires = false;
  double trails_s = 0.0;
};

void add_look_flags(CLI::App& app, LookFlags& flags);
// Throws scene::InputError when the size is none.
Look look_of(const LookFlags& flags);

}  // namespace smartsurf::run

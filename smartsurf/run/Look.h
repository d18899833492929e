// How pictures and videos show the scene: what the flags --camera, --wires, --cells, --palette and --trails
// say.
#pragma once

#include <memory>
#include <string>

#include "smartsurf/view/Camera.h"
#include "smartsurf/view/Overlay.h"

namespace CLI {
class App;
}

namespace smartsurf::run {

struct Look {
  view::Preset camera = view::Preset::kIso;
  bool wires = false;
  view::OverlaySettings overlay;
};

// The flags as typed.
struct LookFlags {
  std::string camera = "iso", cells, palette = "viridis";
  bool wires = false;
  double trails_s = 0.0;
};

void add_look_flags(CLI::App& app, LookFlags& flags);
Look look_of(const LookFlags& flags);

}  // namespace smartsurf::run

// The panel and the help over the scene, in Dear ImGui. Internal to the room: between ImGui::NewFrame and
// ImGui::Render, in the window's context.
#pragma once

#include <string>

#include "smartsurf/scene/Snapshot.h"
#include "smartsurf/view/Controls.h"

namespace smartsurf::view {

struct HudState {
  double render_ms = 0.0;
  std::string message;  // of the last picture: where it is, or why it is not
};

// Fonts and colours, once after the ImGui context is made. scale: of the display.
void set_up_hud(float scale);

// The panel's buttons press keys on the controls.
void draw_hud(const scene::Snapshot& snapshot, const Status& status, const HudState& state, Controls& controls,
              float scale);
void draw_help(float scale);
// Letters at the ends of the axes.
void draw_axis_names(const scene::SurfaceSpec& surface, const Camera& camera, float width, float height);

}  // namespace smartsurf::view

// The panel and the help over the scene, in Dear ImGui. Internal to the room: between ImGui::NewFrame and
// ImGui::Render, in the window's context.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "smartsurf/scene/Snapshot.h"
#include "smartsurf/view/Controls.h"
#include "smartsurf/view/Watch.h"

namespace smartsurf::view {

struct HudState {
  double render_ms = 0.0, interval_ms = 0.0;  // smoothed: of drawing a frame, and from one frame to the next
  std::string message;                        // of the last picture: where it is, or why it is not
  bool filming = false;
  double covered = 0.0;  // share of the window, from its lower edge, behind the timeline when last drawn
  std::vector<OptionEdit> edits;
  Watch watch;
};

// Fonts and colours, once after the ImGui context is made. scale: of the display.
void set_up_hud(float scale);

// All panels: the run's, the picked thing's, the timeline, the legend. Buttons press keys on the controls.
void draw_hud(const Moment& moment, const Status& status, const std::optional<HeatScale>& heat,
              HudState& state, Controls& controls, float scale);
void draw_help(float scale);
// The label and number above every object.
void draw_labels(const Moment& moment, const Camera& camera, float width, float height);
// Whether a panel that takes the pointer covers that place, as drawn last.
bool over_panel(double x, double y);
// Letters at the ends of the axes.
void draw_axis_names(const scene::SurfaceSpec& surface, const Camera& camera, float width, float height);

}  // namespace smartsurf::view

// The panel and the help over the scene, in Dear ImGui. Internal to the room: between ImGui::NewFrame and
// ImGui::Render, in the window's context.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "smartsurf/scene/Snapshot.h"
#include "smartsurf/view/interaction/Controls.h"
#include "smartsurf/view/model/PlotHistory.h"

namespace smartsurf::view {

struct HudState {
  double render_ms = 0.0, interval_ms = 0.0;  // smoothed: of drawing a frame, and from one frame to the next
  std::string message;                        // of the last picture: where it is, or why it is not
  bool filming = false;
  Covered covered;  // by the timeline, and by the run's panel while its sections were closed
  std::vector<OptionEdit> edits;
  PlotHistory watch;
};

// Fonts and colours, once after the ImGui context is made. scale: of the display.
void set_up_hud(float scale);

// All panels: the run's, the picked thing's, the timeline, the legend. Buttons press keys on the controls.
void draw_hud(const FrameInput& moment, const Status& status, const std::optional<HeatScale>& heat,
              HudState& state, Controls& controls, float scale);
void draw_help(float scale);
// The label and number above every object.
void draw_labels(const FrameInput& moment, const Camera& camera, float width, float height);
// Whether a panel that takes the pointer covers that place, as drawn last.
bool over_panel(double x, double y);
// Letters at the ends of the axes.
void draw_axis_names(const scene::SurfaceSpec& surface, const Camera& camera, float width, float height);

}  // namespace smartsurf::view

// The status panel and the help, in Dear ImGui. Internal to this module: called between ImGui::NewFrame and
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
  bool recording_video = false;
  ViewInsets insets;  // by the timeline, and by the run's panel while its sections were closed
  std::vector<OptionEdit> option_edits;
  PlotHistory plot_history;
};

// Fonts and colours, once after the ImGui context is made. scale: of the display.
void setup_imgui_style(float scale);

// All panels: the run's, the picked thing's, the timeline, the legend. Buttons press keys on the controls.
void draw_hud(const FrameInput& input, const Status& status, const std::optional<ColourScale>& colour_scale,
              HudState& state, Controls& controls, float scale);
void draw_help_overlay(float scale);
// The label and number above every object.
void draw_object_labels(const FrameInput& input, const Camera& camera, float width, float height);
// Whether a panel that takes the pointer covers that place, as drawn last.
bool is_over_panel(double x, double y);
// Letters at the ends of the axes.
void draw_axis_labels(const scene::SurfaceSpec& surface, const Camera& camera, float width, float height);

}  // namespace smartsurf::view

// The panels beside the scene, in Dear ImGui. Internal to smartsurf/view. Functions are called between
// ImGui::NewFrame and ImGui::Render. scale: of the display; areas: points of the window.
#pragma once

#include <string>
#include <vector>

#include "smartsurf/view/interaction/Controls.h"
#include "smartsurf/view/model/PlotData.h"
#include "smartsurf/view/panels/HudState.h"

namespace smartsurf::view {

// Begins a window that fills the area; ends with ImGui::End.
void begin_dock(const char* name, const DockRect& area, bool scrolls = true);

// The state of the run, what is shown, tools, options, the list.
void draw_main_panel(const FrameInput& input, const Status& status, const scene::SurfaceSpec& surface,
                     const Overlay& overlay, const DockRect& area, HudState& state, Controls& controls,
                     float scale);
// Runs, pauses, steps, restarts, sets the speed, and seeks on the timeline, along the lower edge.
void draw_bar(const Status& status, const DockRect& area, HudState& state, Controls& controls, float scale);
std::string format_pace(double pace);  // "2×", "1/4×", "max"

// The list of channels and objects with its search; a click selects.
void draw_entities_section(const FrameInput& input, const scene::SurfaceSpec& surface, HudState& state,
                           Controls& controls);

// The state and the stored history of the selected item. No-op if nothing is selected.
void draw_inspector_panel(const FrameInput& input, const Status& status, const scene::SurfaceSpec& surface,
                          const DockRect& area, HudState& state, Controls& controls, float scale);
// The chosen signals over time, one chart per unit. A click on a chart seeks.
void draw_plots_panel(const FrameInput& input, const Status& status, const DockRect& area, HudState& state,
                      Controls& controls);

// The last item can be dragged onto the plots, which then show the signals. No-op without signals.
void make_draggable(const std::vector<Signal>& signals);

// One chart of a PlotData.
struct Chart {
  const char* id;
  std::vector<std::size_t> series;  // indices
  std::string unit;
  double from_s, to_s;
  double now_s;  // a vertical line marks it
};
// Returns the time that the user has clicked.
std::optional<double> draw_chart(const PlotData& data, const Chart& chart, float width, float height);

// The colour scale in the current window, of that width in pixels.
void draw_colour_scale(const ColourScale& colour_scale, float width, float scale);
// The colour scale as a window at the right; bottom: y of its lower edge, pixels.
void draw_legend(const ColourScale& colour_scale, float bottom, float scale);
// Explains the lines in the scene, in the current window. missing: lines of text about what cannot be shown,
// or "".
void draw_line_legend(const OverlaySettings& overlay, const std::optional<ForceScale>& forces,
                      const std::string& missing, float scale);

}  // namespace smartsurf::view

// The panels over the scene, in Dear ImGui: display settings, tools, options, inspector, legend. Internal to
// smartsurf/view. Functions are called between ImGui::NewFrame and ImGui::Render.
#pragma once

#include <vector>

#include "smartsurf/view/interaction/Controls.h"
#include "smartsurf/view/model/PlotData.h"
#include "smartsurf/view/panels/HudState.h"

namespace smartsurf::view {

// Collapsible sections of the run panel.
void draw_visibility_section(const FrameInput& input, const Status& status, Controls& controls);
void draw_tools_section(const Status& status, Controls& controls);
// The section's button requests a reset, which applies the changed options.
void draw_options_section(const Status& status, std::vector<OptionEdit>& edits, Controls& controls);

// The list of channels and objects with its search; a click selects.
void draw_entities_section(const FrameInput& input, const scene::SurfaceSpec& surface, HudState& state,
                           Controls& controls);

// The area that the inspector may cover, pixels.
struct InspectorSpace {
  float top, bottom;
};
inline constexpr float kInspectorWidth = 336.0f;  // with its distance from the right edge, pixels, unscaled

// The state and the stored history of the selected item, at the right; scrolls what does not fit. Returns the
// x of its left edge, or the width of the display if nothing is selected.
float draw_inspector_panel(const FrameInput& input, const Status& status, const scene::SurfaceSpec& surface,
                           HudState& state, Controls& controls, const InspectorSpace& space, float scale);
// The chosen signals over time, one chart per unit, in a strip above `bottom`. A click on a chart seeks.
// Returns the y of the strip's upper edge.
float draw_plots_panel(const FrameInput& input, const Status& status, HudState& state, Controls& controls,
                       float bottom, float scale);

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
inline constexpr std::size_t kCurveColours = 7;
unsigned curve_colour(std::size_t index);  // an ImU32
// Returns the time that the user has clicked.
std::optional<double> draw_chart(const PlotData& data, const Chart& chart, float width, float height);

// The colour scale at the right; bottom: y of its lower edge, pixels. Returns the y of its upper edge.
float draw_legend(const ColourScale& colour_scale, float bottom, float scale);
// Explains the lines in the scene. missing: lines of text about what cannot be shown, or "". right, bottom:
// its lower right corner, pixels. Returns the y of its upper edge, or `bottom` if there are none.
float draw_line_legend(const OverlaySettings& overlay, const std::optional<ForceScale>& forces,
                       const std::string& missing, float right, float bottom, float scale);

}  // namespace smartsurf::view

// The panels over the scene, in Dear ImGui: display settings, tools, options, inspector, legend. Internal to
// smartsurf/view. Functions are called between ImGui::NewFrame and ImGui::Render.
#pragma once

#include <vector>

#include "smartsurf/view/interaction/Controls.h"
#include "smartsurf/view/model/PlotHistory.h"

namespace smartsurf::view {

// Collapsible sections of the run panel.
void draw_visibility_section(const FrameInput& input, const Status& status, Controls& controls);
void draw_tools_section(const Status& status, Controls& controls);
// The section's button requests a reset, which applies the changed options.
void draw_options_section(const Status& status, std::vector<OptionEdit>& edits, Controls& controls);

// The state and the recent history of the selected item, at the right.
void draw_inspector_panel(const FrameInput& input, const PlotHistory& history, Controls& controls,
                          float scale);
// The colour scale at the right; bottom: y of its lower edge, pixels.
void draw_legend(const ColourScale& colour_scale, float bottom, float scale);

}  // namespace smartsurf::view

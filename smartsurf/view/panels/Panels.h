// The panels beside the scene, in Dear ImGui: display settings, tools, options, inspector, legend. Internal
// to this module: called between ImGui::NewFrame and ImGui::Render, in the window's context.
#pragma once

#include <vector>

#include "smartsurf/view/interaction/Controls.h"
#include "smartsurf/view/model/PlotHistory.h"

namespace smartsurf::view {

// Sections of the panel at the left, that open and close.
void draw_visibility_section(const FrameInput& input, const Status& status, Controls& controls);
void draw_tools_section(const Status& status, Controls& controls);
// changed values take effect with the reset that the section's button asks for.
void draw_options_section(const Status& status, std::vector<OptionEdit>& edits, Controls& controls);

// At the right: the state of the picked thing and its recent past.
void draw_inspector_panel(const FrameInput& input, const PlotHistory& history, Controls& controls,
                          float scale);
// Above the timeline at the right.
void draw_legend(const ColourScale& colour_scale, float bottom, float scale);

}  // namespace smartsurf::view

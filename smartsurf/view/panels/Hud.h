// All panels, the labels and the help, in Dear ImGui. Internal to smartsurf/view.
//
// Unless noted otherwise, functions are called between ImGui::NewFrame and ImGui::Render. scale: of the
// display.
#pragma once

#include "smartsurf/scene/Snapshot.h"
#include "smartsurf/view/interaction/Controls.h"
#include "smartsurf/view/interaction/Overlay.h"
#include "smartsurf/view/panels/HudState.h"

namespace smartsurf::view {

// Sets fonts and colours. Call once after creating the ImGui context.
void setup_imgui_style(float scale);

// Draws the panels of state.docks. Buttons act on `controls`.
void draw_hud(const FrameInput& input, const Status& status, const scene::SurfaceSpec& surface,
              const Overlay& overlay, HudState& state, Controls& controls, float scale);
void draw_help_overlay(float scale);
// Draws label and id above the objects, 1000 at most. area: of the scene in the window.
void draw_object_labels(const FrameInput& input, const Camera& camera, const DockRect& area);
// True if a panel that accepts input covers the point in the last frame. Callable at any time.
bool is_over_panel(double x, double y);
// Draws the letters at the ends of the axes.
void draw_axis_labels(const scene::SurfaceSpec& surface, const Camera& camera, const DockRect& area);

}  // namespace smartsurf::view

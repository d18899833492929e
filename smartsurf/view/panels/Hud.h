// The status panel, the timeline, the labels and the help, in Dear ImGui. Internal to smartsurf/view.
//
// Unless noted otherwise, functions are called between ImGui::NewFrame and ImGui::Render. scale: of the
// display.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "smartsurf/scene/Snapshot.h"
#include "smartsurf/view/interaction/Controls.h"
#include "smartsurf/view/interaction/Overlay.h"
#include "smartsurf/view/model/EntityList.h"
#include "smartsurf/view/model/PlotData.h"

namespace smartsurf::view {

struct HudState {
  double render_ms = 0.0, interval_ms = 0.0;  // smoothed time to draw a frame and between frames
  std::string message;                        // path of the last screenshot or video, or the error
  bool recording_video = false;
  ViewInsets insets;  // of the timeline, the plots, the inspector and the run panel's initial size
  float free_bottom =
      0.0f;  // the upper edge of the timeline and the plots in the last frame, pixels; 0: unknown
  std::vector<OptionEdit> option_edits;
  PlotData inspected;        // all signals of the selected item
  PlotData plotted;          // those that the user has chosen
  double plot_span_s = 0.0;  // the latest seconds that the plots show; 0: all
  std::string plot_file;     // names of exported plots, without extension
  EntityList entities;
  std::string entity_query;
  bool entities_were_shown = false;
};

// Sets fonts and colours. Call once after creating the ImGui context.
void setup_imgui_style(float scale);

// Draws all panels: run, inspector, plots, timeline and legends. Buttons act on `controls`.
void draw_hud(const FrameInput& input, const Status& status, const scene::SurfaceSpec& surface,
              const Overlay& overlay, HudState& state, Controls& controls, float scale);
void draw_help_overlay(float scale);
// Draws label and id above the objects, 1000 at most.
void draw_object_labels(const FrameInput& input, const Camera& camera, float width, float height);
// Whether a panel that accepts input covers the point, as of the last frame. Callable at any time.
bool is_over_panel(double x, double y);
// Draws the letters at the ends of the axes.
void draw_axis_labels(const scene::SurfaceSpec& surface, const Camera& camera, float width, float height);

}  // namespace smartsurf::view

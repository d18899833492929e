// The state that the panels keep from frame to frame. Internal to smartsurf/view.
#pragma once

#include <string>
#include <vector>

#include "smartsurf/view/interaction/Controls.h"
#include "smartsurf/view/model/EntityList.h"
#include "smartsurf/view/model/PlotData.h"
#include "smartsurf/view/panels/DockLayout.h"

namespace smartsurf::view {

struct HudState {
  double render_ms = 0.0, interval_ms = 0.0;  // smoothed time to draw a frame and between frames
  std::string message;                        // path of the last screenshot or video, or the error
  bool recording_video = false;
  DockSizes sizes;
  DockLayout docks;                                   // of this frame
  float bar_height = 56.0f, message_height = 110.0f;  // of the contents in the last frame
  std::vector<OptionEdit> option_edits;
  PlotData inspected;        // all signals of the selected item
  PlotData plotted;          // those that the user has chosen
  double plot_span_s = 0.0;  // the latest seconds that the plots show; 0: all
  std::string plot_file;     // names of exported plots, without extension
  EntityList entities;
  std::string entity_query;
  bool entities_were_shown = false;
};

}  // namespace smartsurf::view

// Icons of the window's buttons, drawn from lines and polygons. Internal to smartsurf/view; called between
// ImGui::NewFrame and ImGui::Render.
#pragma once

namespace smartsurf::view {

enum class Icon {
  kNone,
  kRun,
  kPause,
  kBack,
  kForward,
  kRestart,
  kSlower,
  kFaster,
  kMaxSpeed,
  kWireframe,
  kGrid,
  kTrails,
  kForces,
  kSensors,
  kLabels,
  kCells,
  kFollow,
  kList,
  kPlots,
  kTopView,
  kWholeTable,
  kSideView,
  kPicture,
  kVideo,
  kHelp,
  kOpen
};

// A button with an icon before its words; highlighted while `on`. width: pixels; 0: that of the contents.
// Returns whether it was pressed.
bool icon_button(Icon icon, const char* label, const char* tooltip, bool on = false, float width = 0.0f);

}  // namespace smartsurf::view

// The places of the window's panels: docked to its edges, beside the scene and never over it. No Dear ImGui.
#pragma once

#include <string>
#include <string_view>

namespace smartsurf::view {

// Points of the window, y down from its upper edge.
struct DockRect {
  float x = 0.0f, y = 0.0f, width = 0.0f, height = 0.0f;
  float right() const { return x + width; }
  float bottom() const { return y + height; }
  bool empty() const { return width <= 0.0f || height <= 0.0f; }
  bool contains(float at_x, float at_y) const {
    return at_x >= x && at_x < right() && at_y >= y && at_y < bottom();
  }
  bool operator==(const DockRect&) const = default;
};

// The sizes that the user has given to the docks, points at scale 1; 0: the default.
struct DockSizes {
  float side = 0.0f;       // width of the panel at the left, in a wide window
  float top = 0.0f;        // its height at the top, in a tall window
  float inspector = 0.0f;  // width
  float plots = 0.0f;      // height
  bool operator==(const DockSizes&) const = default;
};
// One line per size that is not the default: "side 320".
std::string format_sizes(const DockSizes& sizes);
// The inverse. Ignores unknown names and sizes outside [0, 10000].
DockSizes parse_sizes(std::string_view text);

struct DockContents {
  bool panels = true;  // the main panel and the bar; without them only the message is shown
  bool inspector = false, plots = false;
  float bar_height = 0.0f, message_height = 0.0f;  // 0: none
};

// The areas do not overlap and fill the window; those that are not shown are empty.
struct DockLayout {
  DockRect scene, main, inspector, plots, bar, message;
  bool tall = false;  // the main panel is at the top, with the inspector beside it
};
// The scene keeps at least half of the width and a third of the height. scale: of the display.
DockLayout lay_out_docks(float width, float height, const DockContents&, const DockSizes&, float scale);

}  // namespace smartsurf::view

// The sizes that the user has given to the window's panes, and their text form.
#pragma once

#include <string>
#include <string_view>

namespace apron::ui {

// Sizes in points; 0 is the default for the window's size.
struct PaneSizes {
  float registers = 0.0F;  // width of the register list
  float program = 0.0F;    // width of the program, in the wide layout
  float bottom = 0.0F;     // height of the row below
  float values = 0.0F;     // width of the values in that row

  bool operator==(const PaneSizes&) const = default;
};

// The wide layout has a column for the program; the narrow one shows it as a tab.
struct PaneLayout {
  PaneSizes wide, narrow;

  bool operator==(const PaneLayout&) const = default;
};

// One line per size that differs from the default: "wide.program 420".
std::string format_layout(const PaneLayout& layout);
// The inverse. Ignores unknown names and sizes outside [0, 10000].
PaneLayout parse_layout(std::string_view text);

}  // namespace apron::ui

// The file that remembers the sizes of the window's panes.
#pragma once

#include "apron/ui/PaneLayout.h"

namespace apron::run {

// Reads $XDG_CONFIG_HOME/smartsurf/apron-window.layout, below ~/.config if the variable is not set; without a
// file, the default. reset: removes the file first.
ui::PaneLayout load_layout(bool reset);
// Replaces the file. Does nothing if it cannot be written, because a lost layout must not end the program.
void save_layout(const ui::PaneLayout& layout);

}  // namespace apron::run

// `smartsurf` without arguments, on a display: the start screen.
#pragma once

#include <string>

namespace smartsurf::run {

// Shows the start screen, runs what the user chooses in a process of its own, and shows the screen again,
// until the user closes it. Returns the exit status.
int start_command();

// Puts a file that is shown in a window at the head of the recent ones.
void note_recent(const std::string& file);

}  // namespace smartsurf::run

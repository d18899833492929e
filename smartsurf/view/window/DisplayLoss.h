// Detects the loss of the X server, after which Xlib would terminate the process. Internal to this module.
#pragma once

namespace smartsurf::view {

// After GLFW has been initialised: from now on a lost display raises a flag instead.
void detect_display_loss();
bool display_lost() noexcept;

}  // namespace smartsurf::view

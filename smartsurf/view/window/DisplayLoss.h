// Notices that the X server is gone, which Xlib answers by ending the process unless told otherwise. Internal
// to this module.
#pragma once

namespace smartsurf::view {

// After GLFW has been initialised: from now on a lost display raises a flag instead.
void detect_display_loss();
bool display_lost() noexcept;

}  // namespace smartsurf::view

// Detects the loss of the X server, which by default makes Xlib terminate the process. Internal to
// smartsurf/view.
#pragma once

namespace smartsurf::view {

// Installs Xlib error handlers that set a flag instead of terminating the process. Call after GLFW's
// initialisation. No effect without X11.
void detect_display_loss();
// True if the connection to the X server has been lost since detect_display_loss().
bool display_lost() noexcept;

}  // namespace smartsurf::view

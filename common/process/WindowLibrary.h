// The libraries that a window needs in addition to a display.
#pragma once

namespace common {

// Throws UserError, one line that names the packages, if a display is set but X11's library, which windows
// load at run time, is not installed.
void require_window_library();

}  // namespace common

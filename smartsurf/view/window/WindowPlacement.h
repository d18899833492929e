// The place of a new window.
#pragma once

namespace smartsurf::view {

// kLeft: the left part of the screen, beside another program's window.
enum class WindowPlacement { kDefault, kLeft };

}  // namespace smartsurf::view

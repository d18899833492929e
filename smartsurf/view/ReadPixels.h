// Internal to the room.
#pragma once

#include "smartsurf/view/Image.h"

namespace smartsurf::view {

// The framebuffer's colours, right way up. The context that owns it must be current.
Image read_pixels(unsigned framebuffer, int width, int height);

}  // namespace smartsurf::view

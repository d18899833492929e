// Reads what OpenGL has drawn.
#pragma once

#include "common/image/Image.h"

namespace common {

// The colours of the framebuffer that is bound for reading. Its context must be current.
Image read_framebuffer(int width, int height);

}  // namespace common

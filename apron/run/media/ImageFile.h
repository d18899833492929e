// Reads and writes images as grey values 0 to 255: PNG, PGM, JPEG and BMP, by extension. Row 0 is the top.
#pragma once

#include <string>

#include "apron/run/media/GreyFrame.h"
#include "apron/vm/Plane.h"

namespace apron::run {

// Converts colours to luminance and scales other ranges, such as 16 bits, to 0 to 255. Throws MediaError,
// also for an image that does not have the plane's shape; the plane may then be partly written.
void read_image(const std::string& path, const vm::Plane& to);

// A picture of any size up to program::kMaxCells pixels, rounded to whole values. Throws MediaError.
GreyFrame read_frame(const std::string& path);

// True if the name has the extension of a picture.
bool is_image_name(const std::string& path);

// Rounds and clamps to whole values from 0 to 255; NaN becomes 0. Throws MediaError.
void write_image(const std::string& path, const vm::ConstPlane& from);

}  // namespace apron::run

// Images as grey values 0 to 255: PNG, PGM, JPEG and BMP, by extension. Row 0 is the top.
#pragma once

#include <string>

#include "apron/vm/Plane.h"

namespace apron::run {

// Colours become their luminance, 16-bit and other scales 0 to 255. Throws MediaError, for a picture that is
// not of the plane's shape too; the plane may then be partly written.
void read_image(const std::string& path, const vm::Plane& to);

// Rounded to whole values and clamped; a NaN is black. Throws MediaError.
void write_image(const std::string& path, const vm::ConstPlane& from);

}  // namespace apron::run

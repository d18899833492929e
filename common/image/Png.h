// PNG files.
#pragma once

#include <filesystem>

#include "common/image/Image.h"

namespace common {

// Throws UserError when it cannot be read or has more than 2^26 pixels.
Image read_png(const std::filesystem::path& path);
// Replaces the file as a whole. Throws UserError when it cannot be written (missing folder, no permission,
// full disk).
void write_png(const std::filesystem::path& path, const Image& image);

}  // namespace common

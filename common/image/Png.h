// PNG files.
#pragma once

#include <filesystem>

#include "common/image/Image.h"

namespace common {

// Replaces the file as a whole. Throws UserError when it cannot be written (missing folder, no permission,
// full disk).
void write_png(const std::filesystem::path& path, const Image& image);

}  // namespace common

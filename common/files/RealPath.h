// The name of a file without links.
#pragma once

#include <filesystem>

namespace common {

// Absolute, also of a file that does not exist: a link to it stands for the file that it names. Empty if the
// links have no end or a folder cannot be read.
std::filesystem::path real_path(const std::filesystem::path&);

}  // namespace common

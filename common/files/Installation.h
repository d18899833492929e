// The place of the running code, and the files that come with it.
#pragma once

#include <filesystem>

namespace common {

// This program's file; "" if the system does not say. Needs no /proc.
std::filesystem::path program_path();

// `name` below share/smartsurf of the installation to which this program or Python module belongs, or below
// scripts/ of the source tree; "" if neither has it.
std::filesystem::path installed_file(const std::filesystem::path& name);

// A file of the font DejaVu: the system's, or that of the installation; "" if there is none.
std::filesystem::path font_file(const char* name);

}  // namespace common

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

// The characters of that font that windows show, as first and last codes of ranges, ended by 0: Latin, Greek
// and Cyrillic letters, punctuation, arrows, mathematical signs, geometric shapes.
inline constexpr unsigned short kGlyphRanges[] = {0x20,   0x24F,  0x370,  0x52F,  0x1E00, 0x1EFF, 0x2010,
                                                  0x20BF, 0x2190, 0x22FF, 0x25A0, 0x25FF, 0};

}  // namespace common

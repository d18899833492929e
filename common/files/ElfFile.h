// Checks a shared object before the dynamic linker maps it.
#pragma once

#include <filesystem>
#include <string>

namespace common {

// "", or in one clause that the file ends before the segments that its program headers name: the first access
// to one would raise SIGBUS. What is not a 64-bit ELF file is left to the dynamic linker.
std::string find_missing_segment(const std::filesystem::path& file);

}  // namespace common

// The file that a program's name stands for.
#pragma once

#include <filesystem>
#include <string>

namespace common {

// The first executable file of that name in the folders of PATH, which an empty entry makes the current one;
// "" if there is none.
std::filesystem::path program_on_path(const std::string& name);

}  // namespace common

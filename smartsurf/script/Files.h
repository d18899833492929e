// Reading script files. Internal to the room.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace smartsurf::script {

// The file's text; nullopt, and in `problem` what is wrong with it ("does not exist"), when it cannot be had.
std::optional<std::string> read_script(const std::filesystem::path& path, std::string& problem);

}  // namespace smartsurf::script

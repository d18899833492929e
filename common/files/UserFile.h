// Small text files that a program keeps for the user between its runs, in $XDG_CONFIG_HOME/smartsurf, below
// ~/.config if the variable is not set. Nothing depends on them: what cannot be read is empty, and what
// cannot be written is lost.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace common {

// Empty if the environment names no home.
std::filesystem::path user_file(const std::string& name);
std::string read_user_file(const std::string& name);
void write_user_file(const std::string& name, std::string_view text);
void remove_user_file(const std::string& name);

}  // namespace common

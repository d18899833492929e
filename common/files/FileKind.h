// What a file is, so that a user who gives it to the wrong program is told the right one.
#pragma once

#include <filesystem>
#include <string_view>

namespace common {

enum class FileKind {
  kOther,
  kExperiment,  // Lua
  kProgram,     // APRON
  kRecording,   // HDF5
};

// By the first bytes (a signature, or the comment that most scripts begin with), else by the name's ending.
FileKind file_kind(const std::filesystem::path& path, std::string_view first_bytes);

}  // namespace common

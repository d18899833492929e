// Recognises files by their content, so that a message can name the program for which they are.
#pragma once

#include <filesystem>
#include <string_view>

namespace common {

enum class FileKind {
  kOther,
  kExperiment,  // Lua
  kProgram,     // APRON
  kRecording,   // HDF5
  kMesh,
  kModel,  // URDF or MJCF
  kPicture,
};

// By the first bytes (a signature, or the comment that most scripts begin with), else by the name's ending.
FileKind file_kind(const std::filesystem::path& path, std::string_view first_bytes);
// The same of a file that may be missing or unreadable: kOther.
FileKind file_kind(const std::filesystem::path& path);
// "a recording"; "" for kOther.
std::string_view description(FileKind);

}  // namespace common

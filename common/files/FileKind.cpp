#include "common/files/FileKind.h"

#include <fstream>
#include <string>

namespace common {

FileKind file_kind(const std::filesystem::path& path, std::string_view first_bytes) {
  using namespace std::string_view_literals;
  if (first_bytes.starts_with("\x89HDF\r\n\x1a\n"sv)) return FileKind::kRecording;
  const std::size_t begin = first_bytes.find_first_not_of(" \t\r\n");
  const std::string_view text = begin == first_bytes.npos ? ""sv : first_bytes.substr(begin);
  if (text.starts_with("--")) return FileKind::kExperiment;
  if (text.starts_with("//")) return FileKind::kProgram;
  if (first_bytes.starts_with("\x89PNG\r\n"sv) || first_bytes.starts_with("\xff\xd8\xff"sv))
    return FileKind::kPicture;
  if (first_bytes.starts_with("glTF"sv) || first_bytes.starts_with("ply\n"sv)) return FileKind::kMesh;
  for (const std::string_view start : {"<?xml"sv, "<robot"sv, "<mujoco"sv})
    if (text.starts_with(start)) return FileKind::kModel;
  const std::filesystem::path ending = path.extension();
  for (const char* const mesh : {".stl", ".obj", ".ply", ".gltf", ".glb", ".3mf"})
    if (ending == mesh) return FileKind::kMesh;
  return ending == ".lua"                        ? FileKind::kExperiment
         : ending == ".aps"                      ? FileKind::kProgram
         : ending == ".urdf" || ending == ".xml" ? FileKind::kModel
                                                 : FileKind::kOther;
}

FileKind file_kind(const std::filesystem::path& path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) return FileKind::kOther;
  std::string start(64, '\0');
  std::ifstream file(path, std::ios::binary);
  file.read(start.data(), static_cast<std::streamsize>(start.size()));
  start.resize(file.gcount());
  return file_kind(path, start);
}

std::string_view description(FileKind kind) {
  switch (kind) {
    case FileKind::kExperiment:
      return "an experiment";
    case FileKind::kProgram:
      return "an APRON program";
    case FileKind::kRecording:
      return "a recording";
    case FileKind::kMesh:
      return "a mesh";
    case FileKind::kModel:
      return "a robot description";
    case FileKind::kPicture:
      return "a picture";
    case FileKind::kOther:
      break;
  }
  return "";
}

}  // namespace common

#include "common/files/FileKind.h"

namespace common {

FileKind file_kind(const std::filesystem::path& path, std::string_view first_bytes) {
  using namespace std::string_view_literals;
  if (first_bytes.starts_with("\x89HDF\r\n\x1a\n"sv)) return FileKind::kRecording;
  const std::size_t begin = first_bytes.find_first_not_of(" \t\r\n");
  const std::string_view text = begin == first_bytes.npos ? ""sv : first_bytes.substr(begin);
  if (text.starts_with("--")) return FileKind::kExperiment;
  if (text.starts_with("//")) return FileKind::kProgram;
  const std::filesystem::path ending = path.extension();
  return ending == ".lua" ? FileKind::kExperiment : ending == ".aps" ? FileKind::kProgram : FileKind::kOther;
}

}  // namespace common

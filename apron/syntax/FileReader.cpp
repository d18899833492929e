#include "apron/syntax/FileReader.h"

#include <filesystem>

#include "common/files/ReadFile.h"

namespace apron::syntax {

std::optional<std::string> DiskReader::read(const std::string& path) {
  std::error_code error;
  if (program_ && path != *program_ && std::filesystem::canonical(path, error).extension() != ".aps")
    return std::nullopt;
  std::string text;
  if (common::read_file(path, common::kMaxTextBytes, text)) return std::nullopt;
  return text;
}

std::optional<std::string> MemoryReader::read(const std::string& path) {
  const auto file = files.find(path);
  if (file == files.end()) return std::nullopt;
  return file->second;
}

}  // namespace apron::syntax

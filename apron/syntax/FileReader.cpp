#include "apron/syntax/FileReader.h"

#include "common/files/ReadFile.h"

namespace apron::syntax {

std::optional<std::string> DiskReader::read(const std::string& path) {
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

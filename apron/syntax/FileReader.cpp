#include "apron/syntax/FileReader.h"

#include <filesystem>
#include <fstream>
#include <iterator>
#include <system_error>

namespace apron::syntax {

std::optional<std::string> DiskReader::read(const std::string& path) {
  std::error_code error;
  if (std::filesystem::is_directory(path, error)) return std::nullopt;
  std::ifstream stream(path, std::ios::binary);
  if (!stream) return std::nullopt;
  std::string text{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
  if (stream.bad()) return std::nullopt;
  return text;
}

std::optional<std::string> MemoryReader::read(const std::string& path) {
  const auto file = files.find(path);
  if (file == files.end()) return std::nullopt;
  return file->second;
}

}  // namespace apron::syntax

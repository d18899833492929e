#include "apron/syntax/SourceManager.h"

#include <fmt/format.h>

#include <utility>

namespace apron::syntax {

SourceManager::SourceManager() : expansions_(1) {}

std::uint32_t SourceManager::add_file(std::string name, std::string text, Location included_from) {
  SourceFile file{std::move(name), std::move(text), included_from, {0}};
  for (std::size_t i = 0; i < file.text.size(); ++i) {
    if (file.text[i] == '\n') file.line_starts.push_back(i + 1);
  }
  files_.push_back(std::move(file));
  return static_cast<std::uint32_t>(files_.size() - 1);
}

std::uint32_t SourceManager::add_expansion(std::string macro, Location call, std::size_t operand_count,
                                           bool is_function) {
  expansions_.push_back({std::move(macro), call, static_cast<std::uint32_t>(operand_count), is_function});
  return static_cast<std::uint32_t>(expansions_.size() - 1);
}

std::string_view SourceManager::line_text(std::uint32_t file, std::uint32_t line) const {
  if (file >= files_.size()) return {};
  const SourceFile& source = files_[file];
  if (line == 0 || line > source.line_starts.size()) return {};
  const std::size_t first = source.line_starts[line - 1];
  std::string_view text = std::string_view(source.text).substr(first);
  text = text.substr(0, text.find('\n'));
  if (!text.empty() && text.back() == '\r') text.remove_suffix(1);
  return text;
}

std::string SourceManager::format_location(const Location& location) const {
  const std::string file = location.file < files_.size() ? files_[location.file].name : "";
  return fmt::format("{}:{}:{}", file, location.line, location.column);
}

}  // namespace apron::syntax

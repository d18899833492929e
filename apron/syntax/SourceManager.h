// The source texts of a program and source locations: file, line, column, and the chain of macro expansions
// and includes. A file included twice appears twice, each with its own chain.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace apron::syntax {

struct Location {
  std::uint32_t file = 0;              // index of SourceManager::file
  std::uint32_t line = 0, column = 0;  // from 1; the column counts characters; line 0: unknown
  std::uint32_t expansion = 0;         // index of SourceManager::expansion; 0: not inside a macro

  bool operator==(const Location&) const = default;
};

struct SourceFile {
  std::string name;  // as shown to the user
  std::string text;
  Location included_from;  // line 0 for the main file
  std::vector<std::size_t> line_starts;
};

struct ExpansionInfo {
  std::string macro;  // or function
  Location call;
  std::uint32_t operand_count = 0;
  bool is_function = false;
};

class SourceManager {
 public:
  SourceManager();

  std::uint32_t add_file(std::string name, std::string text, Location included_from);
  std::uint32_t add_expansion(std::string macro, Location call, std::size_t operand_count, bool is_function);

  const SourceFile& file(std::uint32_t index) const { return files_.at(index); }
  const ExpansionInfo& expansion(std::uint32_t index) const { return expansions_.at(index); }
  std::size_t file_count() const noexcept { return files_.size(); }
  std::size_t expansion_count() const noexcept { return expansions_.size(); }

  // The line without its terminator; "" outside the file.
  std::string_view line_text(std::uint32_t file, std::uint32_t line) const;
  // "file:line:col"
  std::string format_location(const Location&) const;

 private:
  std::vector<SourceFile> files_;
  std::vector<ExpansionInfo> expansions_;
};

}  // namespace apron::syntax

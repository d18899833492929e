// A program's text as rows, with included files and macro expansions folded below the line that contains
// them.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "apron/debugger/DebugSession.h"
#include "apron/program/Program.h"
#include "apron/vm/Vm.h"

namespace apron::debugger {

struct SourceText {
  std::string name;  // as Program::files has it
  std::string text;
  std::optional<std::size_t> included_in;  // index of another text; none: the main file
  std::uint32_t included_at_line = 0;      // its line, from 1
};

class Listing {
 public:
  enum class Fold : std::uint8_t { kNone, kClosed, kOpen };
  struct Row {
    std::string text;         // of a title: what follows
    std::string file;         // as Program::files has it
    std::uint32_t line = 0;   // from 1; 0: a title
    std::uint32_t depth = 0;  // how many folds it is in
    Fold fold = Fold::kNone;  // closed: something below it is hidden
    bool has_code = false;    // has instructions
    std::uint32_t node = 0;   // internal
  };

  Listing() = default;
  // All folded. The first text is the main file. Of a text that is included twice the first place is taken.
  Listing(const program::Program& program, const std::vector<SourceText>& texts);

  const std::vector<Row>& rows() const noexcept { return rows_; }
  // Folds or unfolds what is below a row; nothing for a row without.
  void toggle(std::size_t row);
  // Unfolds what hides the instruction's own line.
  void reveal(std::size_t instruction);
  // The row that shows each instruction as it is folded now.
  const InstructionGroups& groups() const noexcept { return groups_; }
  // Sums of counts and times; by row.
  std::vector<vm::InstructionProfile> profile_by_row(
      const std::vector<vm::InstructionProfile>& profile) const;

 private:
  using LineKey = std::pair<std::uint32_t, std::uint32_t>;  // node and line

  // A whole file, or the part of one that a use of a macro runs.
  struct Node {
    std::size_t text = 0;
    std::uint32_t first = 0, last = 0;  // lines; none if first > last
    std::string macro;                  // "": the whole file
    std::optional<LineKey> parent;
  };

  void add_files(const std::vector<SourceText>& texts);
  void add_expansions(const program::Program& program);
  void extend_lines(std::uint32_t node, const program::SourceLocation& location);
  std::uint32_t node_of(const program::SourceLocation& location) const;
  void rebuild();
  void append_rows(std::uint32_t node, std::uint32_t depth);
  std::string title(const Node& node) const;
  std::uint32_t visible_row(const LineKey& line_key) const;
  std::string line_text(std::size_t text, std::uint32_t line) const;

  std::vector<std::vector<std::string>> lines_;  // by text
  std::vector<std::string> names_;
  std::vector<std::size_t> text_of_file_;  // by Program::files
  std::vector<Node> nodes_;
  std::vector<std::uint32_t> node_of_text_, node_of_expansion_;
  std::map<LineKey, std::vector<std::uint32_t>> children_;
  std::map<LineKey, bool> expanded_;
  std::map<LineKey, bool> lines_with_code_;
  std::vector<LineKey> line_of_instruction_;  // by instruction
  std::vector<Row> rows_;
  std::map<LineKey, std::uint32_t> row_of_line_;
  InstructionGroups groups_;
};

}  // namespace apron::debugger

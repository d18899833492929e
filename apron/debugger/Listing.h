// A program's source as rows, with included files and macro expansions folded below the line that contains
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
  std::string name;  // an entry of Program::files
  std::string text;
  std::optional<std::size_t> included_in;  // index of the including text; nullopt for the main file
  std::uint32_t included_at_line = 0;      // 1-based line of the including text
};

// The lines of a text, without their ends.
std::vector<std::string> split_lines(const std::string& text);

// A compiler's message about a place in a source text.
struct SourceDiagnostic {
  std::string file;                    // as SourceText::name
  std::uint32_t line = 0, column = 0;  // 1-based, the column in characters; line 0: unknown
  std::string message;
  bool is_warning = false;
};

class Listing {
 public:
  enum class Fold : std::uint8_t { kNone, kClosed, kOpen };
  struct Row {
    std::string text;         // the source line, or the title of a fold
    std::string file;         // an entry of Program::files
    std::uint32_t line = 0;   // 1-based; 0 for a title
    std::uint32_t depth = 0;  // number of enclosing folds
    Fold fold = Fold::kNone;  // kClosed: rows below it are hidden
    bool has_code = false;    // compiles to instructions
    std::uint32_t node = 0;   // internal
  };

  Listing() = default;
  // Starts fully folded. The first text is the main file. A text included twice appears at its first
  // inclusion.
  Listing(const program::Program& program, const std::vector<SourceText>& texts);

  const std::vector<Row>& rows() const noexcept { return rows_; }
  // Opens or closes the row's fold; ignores rows without one.
  void toggle(std::size_t row);
  // Opens all folds that hide the instruction's line.
  void reveal(std::size_t instruction);
  // Indexed by instruction: the row that currently shows it.
  const InstructionGroups& groups() const noexcept { return groups_; }
  // Sums a profile indexed by instruction into one indexed by row.
  std::vector<vm::InstructionProfile> profile_by_row(
      const std::vector<vm::InstructionProfile>& profile) const;

 private:
  using LineKey = std::pair<std::uint32_t, std::uint32_t>;  // node and line

  // A whole file, or the lines of a file executed by one macro expansion.
  struct Node {
    std::size_t text = 0;
    std::uint32_t first = 0, last = 0;  // line range; empty if first > last
    std::string macro;                  // empty for a whole file
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

  std::vector<std::vector<std::string>> lines_;  // indexed by text
  std::vector<std::string> names_;               // indexed by text
  std::vector<std::size_t> text_of_file_;        // indexed like Program::files
  std::vector<Node> nodes_;
  std::vector<std::uint32_t> node_of_text_, node_of_expansion_;
  std::map<LineKey, std::vector<std::uint32_t>> children_;
  std::map<LineKey, bool> expanded_;
  std::map<LineKey, bool> lines_with_code_;
  std::vector<LineKey> line_of_instruction_;
  std::vector<Row> rows_;
  std::map<LineKey, std::uint32_t> row_of_line_;
  InstructionGroups groups_;
};

}  // namespace apron::debugger

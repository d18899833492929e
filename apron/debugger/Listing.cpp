#include "apron/debugger/Listing.h"

#include <algorithm>

namespace apron::debugger {
namespace {

constexpr std::uint32_t kNoLine = ~0U;

}  // namespace

std::vector<std::string> split_lines(const std::string& text) {
  std::vector<std::string> lines;
  for (std::size_t from = 0; from < text.size();) {
    const std::size_t end = std::min(text.find('\n', from), text.size());
    lines.push_back(text.substr(from, end - from));
    if (!lines.back().empty() && lines.back().back() == '\r') lines.back().pop_back();
    from = end + 1;
  }
  return lines;
}

Listing::Listing(const program::Program& program, const std::vector<SourceText>& texts) {
  add_files(texts);
  for (const std::string& file : program.files) {
    const auto found = std::ranges::find(names_, file);
    text_of_file_.push_back(found == names_.end() ? 0 : found - names_.begin());
  }
  if (nodes_.empty()) return;
  add_expansions(program);
  for (std::size_t i = 0; i < program.code.size(); ++i) {
    const program::SourceLocation* known = program::find_location(program, i);
    const program::SourceLocation location = known != nullptr ? *known : program::SourceLocation{};
    line_of_instruction_.emplace_back(node_of(location), location.line);
    for (LineKey line_key = line_of_instruction_.back();;) {
      lines_with_code_[line_key] = true;
      if (!nodes_[line_key.first].parent || nodes_[line_key.first].macro.empty()) break;
      line_key = *nodes_[line_key.first].parent;
    }
  }
  rebuild();
}

void Listing::add_files(const std::vector<SourceText>& texts) {
  for (std::size_t i = 0; i < texts.size(); ++i) {
    names_.push_back(texts[i].name);
    lines_.push_back(split_lines(texts[i].text));
    node_of_text_.push_back(static_cast<std::uint32_t>(nodes_.size()));
    Node node{i, 1, static_cast<std::uint32_t>(lines_.back().size()), {}, std::nullopt};
    if (texts[i].included_in && *texts[i].included_in < i) {
      node.parent = LineKey{node_of_text_[*texts[i].included_in], texts[i].included_at_line};
      children_[*node.parent].push_back(node_of_text_.back());
    }
    nodes_.push_back(std::move(node));
  }
}

// A macro expansion shows the range from the first to the last line that it executes.
void Listing::add_expansions(const program::Program& program) {
  node_of_expansion_.assign(std::max<std::size_t>(program.expansions.size(), 1), node_of_text_.front());
  for (std::size_t e = 1; e < program.expansions.size(); ++e) {
    const program::Expansion& expansion = program.expansions[e];
    const LineKey parent{node_of(expansion.call_site), expansion.call_site.line};
    node_of_expansion_[e] = static_cast<std::uint32_t>(nodes_.size());
    nodes_.push_back({0, kNoLine, 0, expansion.macro, parent});
  }
  for (const program::SourceLocation& location : program.source_locations)
    if (location.expansion > 0) extend_lines(node_of_expansion_[location.expansion], location);
  // Nested expansions follow the enclosing ones, so iterate backwards to extend the enclosing ranges.
  for (std::size_t e = program.expansions.size(); e-- > 1;) {
    const program::SourceLocation& call = program.expansions[e].call_site;
    const std::uint32_t node = node_of_expansion_[e];
    if (nodes_[node].first > nodes_[node].last) continue;
    if (call.expansion > 0) extend_lines(node_of_expansion_[call.expansion], call);
    auto& children = children_[*nodes_[node].parent];
    children.insert(children.begin(), node);
  }
}

void Listing::extend_lines(std::uint32_t node, const program::SourceLocation& location) {
  Node& extended = nodes_[node];
  const std::size_t text = text_of_file_[location.file];
  if (location.line == 0 || (extended.first <= extended.last && text != extended.text)) return;
  extended.text = text;
  extended.first = std::min(extended.first, location.line);
  extended.last = std::max(extended.last, location.line);
}

std::uint32_t Listing::node_of(const program::SourceLocation& location) const {
  if (location.expansion > 0) return node_of_expansion_[location.expansion];
  return location.file < text_of_file_.size() ? node_of_text_[text_of_file_[location.file]]
                                              : node_of_text_.front();
}

void Listing::rebuild() {
  rows_.clear();
  row_of_line_.clear();
  append_rows(0, 0);
  groups_.clear();
  for (const LineKey& line_key : line_of_instruction_) groups_.push_back(visible_row(line_key));
}

void Listing::append_rows(std::uint32_t node, std::uint32_t depth) {
  const Node& current = nodes_[node];
  for (std::uint32_t line = current.first; line <= current.last; ++line) {
    const LineKey line_key{node, line};
    const auto children = children_.find(line_key);
    const bool open = children != children_.end() && expanded_.count(line_key) > 0;
    row_of_line_[line_key] = static_cast<std::uint32_t>(rows_.size());
    rows_.push_back({line_text(current.text, line), names_[current.text], line, depth,
                     children == children_.end() ? Fold::kNone
                     : open                      ? Fold::kOpen
                                                 : Fold::kClosed,
                     lines_with_code_.count(line_key) > 0, node});
    if (!open) continue;
    for (const std::uint32_t child : children->second) {
      rows_.push_back(
          {title(nodes_[child]), names_[nodes_[child].text], 0, depth + 1, Fold::kNone, false, child});
      append_rows(child, depth + 1);
    }
  }
}

std::string Listing::title(const Node& node) const {
  const std::string& path = names_[node.text];
  const std::string file = path.substr(path.find_last_of('/') + 1);
  return node.macro.empty() ? file : "macro " + node.macro + ", " + file;
}

// The row of the innermost enclosing line that is visible.
std::uint32_t Listing::visible_row(const LineKey& line_key) const {
  for (std::optional<LineKey> ancestor = line_key; ancestor; ancestor = nodes_[ancestor->first].parent) {
    const auto found = row_of_line_.find(*ancestor);
    if (found != row_of_line_.end()) return found->second;
  }
  return 0;
}

std::string Listing::line_text(std::size_t text, std::uint32_t line) const {
  const std::vector<std::string>& lines = lines_[text];
  return line >= 1 && line <= lines.size() ? lines[line - 1] : std::string();
}

void Listing::toggle(std::size_t row) {
  if (row >= rows_.size() || rows_[row].fold == Fold::kNone) return;
  const LineKey line_key{rows_[row].node, rows_[row].line};
  if (expanded_.erase(line_key) == 0) expanded_[line_key] = true;
  rebuild();
}

void Listing::reveal(std::size_t instruction) {
  if (instruction >= line_of_instruction_.size()) return;
  bool changed = false;
  for (std::optional<LineKey> ancestor = nodes_[line_of_instruction_[instruction].first].parent; ancestor;
       ancestor = nodes_[ancestor->first].parent)
    changed = expanded_.try_emplace(*ancestor, true).second || changed;
  if (changed) rebuild();
}

std::vector<vm::InstructionProfile> Listing::profile_by_row(
    const std::vector<vm::InstructionProfile>& profile) const {
  std::vector<vm::InstructionProfile> rows(rows_.size());
  for (std::size_t i = 0; i < std::min(profile.size(), groups_.size()); ++i) {
    rows[groups_[i]].executions += profile[i].executions;
    rows[groups_[i]].nanoseconds += profile[i].nanoseconds;
  }
  return rows;
}

}  // namespace apron::debugger

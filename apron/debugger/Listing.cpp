#include "apron/debugger/Listing.h"

#include <algorithm>

namespace apron::debugger {
namespace {

std::vector<std::string> split(const std::string& text) {
  std::vector<std::string> lines;
  for (std::size_t from = 0; from < text.size();) {
    const std::size_t end = std::min(text.find('\n', from), text.size());
    lines.push_back(text.substr(from, end - from));
    if (!lines.back().empty() && lines.back().back() == '\r') lines.back().pop_back();
    from = end + 1;
  }
  return lines;
}

constexpr std::uint32_t kNowhere = ~0U;

}  // namespace

Listing::Listing(const program::Program& program, const std::vector<SourceText>& texts) {
  add_files(texts);
  for (const std::string& file : program.files) {
    const auto found = std::find(names_.begin(), names_.end(), file);
    text_of_file_.push_back(found == names_.end() ? 0 : static_cast<std::size_t>(found - names_.begin()));
  }
  if (nodes_.empty()) return;
  add_expansions(program);
  for (const program::Instruction& instruction : program.code) {
    const program::SourceLocation at = instruction.source_location < program.source_locations.size()
                                           ? program.source_locations[instruction.source_location]
                                           : program::SourceLocation{};
    place_.emplace_back(node_of(at), at.line);
    for (Place place = place_.back();;) {
      code_[place] = true;
      if (!nodes_[place.first].parent || nodes_[place.first].macro.empty()) break;
      place = *nodes_[place.first].parent;
    }
  }
  rebuild();
}

void Listing::add_files(const std::vector<SourceText>& texts) {
  for (std::size_t i = 0; i < texts.size(); ++i) {
    names_.push_back(texts[i].name);
    lines_.push_back(split(texts[i].text));
    node_of_text_.push_back(static_cast<std::uint32_t>(nodes_.size()));
    Node node{i, 1, static_cast<std::uint32_t>(lines_.back().size()), {}, std::nullopt};
    if (texts[i].included_in && *texts[i].included_in < i) {
      node.parent = Place{node_of_text_[*texts[i].included_in], texts[i].included_at};
      children_[*node.parent].push_back(node_of_text_.back());
    }
    nodes_.push_back(std::move(node));
  }
}

// A use of a macro shows the lines from the first to the last that it runs.
void Listing::add_expansions(const program::Program& program) {
  node_of_expansion_.assign(std::max<std::size_t>(program.expansions.size(), 1), node_of_text_.front());
  for (std::size_t e = 1; e < program.expansions.size(); ++e) {
    const program::Expansion& one = program.expansions[e];
    const Place parent{node_of(one.call_site), one.call_site.line};
    node_of_expansion_[e] = static_cast<std::uint32_t>(nodes_.size());
    nodes_.push_back({0, kNowhere, 0, one.macro, parent});
  }
  for (const program::SourceLocation& at : program.source_locations)
    if (at.expansion > 0) stretch(node_of_expansion_[at.expansion], at);
  // Inner ones come after those that they are in.
  for (std::size_t e = program.expansions.size(); e-- > 1;) {
    const program::SourceLocation& call = program.expansions[e].call_site;
    const std::uint32_t node = node_of_expansion_[e];
    if (nodes_[node].first > nodes_[node].last) continue;
    if (call.expansion > 0) stretch(node_of_expansion_[call.expansion], call);
    auto& children = children_[*nodes_[node].parent];
    children.insert(children.begin(), node);
  }
}

void Listing::stretch(std::uint32_t node, const program::SourceLocation& at) {
  Node& one = nodes_[node];
  const std::size_t text = text_of_file_[at.file];
  if (at.line == 0 || (one.first <= one.last && text != one.text)) return;
  one.text = text;
  one.first = std::min(one.first, at.line);
  one.last = std::max(one.last, at.line);
}

std::uint32_t Listing::node_of(const program::SourceLocation& at) const {
  if (at.expansion > 0) return node_of_expansion_[at.expansion];
  return at.file < text_of_file_.size() ? node_of_text_[text_of_file_[at.file]] : node_of_text_.front();
}

void Listing::rebuild() {
  rows_.clear();
  row_.clear();
  emit(0, 0);
  groups_.clear();
  for (const Place& place : place_) groups_.push_back(row_of(place));
}

void Listing::emit(std::uint32_t node, std::uint32_t depth) {
  const Node& one = nodes_[node];
  for (std::uint32_t line = one.first; line <= one.last; ++line) {
    const Place place{node, line};
    const auto below = children_.find(place);
    const bool open = below != children_.end() && open_.count(place) > 0;
    row_[place] = static_cast<std::uint32_t>(rows_.size());
    rows_.push_back({line_text(one.text, line), names_[one.text], line, depth,
                     below == children_.end() ? Fold::kNone
                     : open                   ? Fold::kOpen
                                              : Fold::kClosed,
                     code_.count(place) > 0, node});
    if (!open) continue;
    for (const std::uint32_t child : below->second) {
      rows_.push_back(
          {title(nodes_[child]), names_[nodes_[child].text], 0, depth + 1, Fold::kNone, false, child});
      emit(child, depth + 1);
    }
  }
}

std::string Listing::title(const Node& node) const {
  const std::string& path = names_[node.text];
  const std::string file = path.substr(path.find_last_of('/') + 1);
  return node.macro.empty() ? file : "macro " + node.macro + ", " + file;
}

// Of the innermost line around it that is shown.
std::uint32_t Listing::row_of(const Place& place) const {
  for (std::optional<Place> at = place; at; at = nodes_[at->first].parent) {
    const auto found = row_.find(*at);
    if (found != row_.end()) return found->second;
  }
  return 0;
}

std::string Listing::line_text(std::size_t text, std::uint32_t line) const {
  const std::vector<std::string>& lines = lines_[text];
  return line >= 1 && line <= lines.size() ? lines[line - 1] : std::string();
}

void Listing::toggle(std::size_t row) {
  if (row >= rows_.size() || rows_[row].fold == Fold::kNone) return;
  const Place place{rows_[row].node, rows_[row].line};
  if (open_.erase(place) == 0) open_[place] = true;
  rebuild();
}

void Listing::reveal(std::size_t instruction) {
  if (instruction >= place_.size()) return;
  bool changed = false;
  for (std::optional<Place> at = nodes_[place_[instruction].first].parent; at; at = nodes_[at->first].parent)
    changed = open_.try_emplace(*at, true).second || changed;
  if (changed) rebuild();
}

std::vector<vm::InstructionProfile> Listing::by_row(const std::vector<vm::InstructionProfile>& spent) const {
  std::vector<vm::InstructionProfile> rows(rows_.size());
  for (std::size_t i = 0; i < std::min(spent.size(), groups_.size()); ++i) {
    rows[groups_[i]].executions += spent[i].executions;
    rows[groups_[i]].nanoseconds += spent[i].nanoseconds;
  }
  return rows;
}

}  // namespace apron::debugger

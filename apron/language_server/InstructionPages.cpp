#include "apron/language_server/InstructionPages.h"

#include <map>
#include <set>
#include <vector>

#include "apron/compiler/Builtins.h"
#include "apron/program/Program.h"

namespace apron::language_server {
namespace {

bool is_name_character(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '.';
}

// "surface.sense" of "D = surface.sense('proximity')": the names within code that a call or nothing follows.
void collect_names(std::string_view code, std::set<std::string>& names) {
  for (std::size_t at = 0; at < code.size();) {
    if (code[at] == '\'') {  // a text
      const std::size_t end = code.find('\'', at + 1);
      at = end == code.npos ? code.size() : end + 1;
      continue;
    }
    std::size_t end = at;
    if (code[end] == '!') ++end;
    while (end < code.size() && is_name_character(code[end])) ++end;
    if (end - at > 1) names.emplace(code.substr(at, end - at));
    at = end > at ? end : at + 1;
  }
}

// The rows of the page's tables by the names in their first column.
std::map<std::string, std::string, std::less<>> read_rows() {
  std::map<std::string, std::string, std::less<>> rows;
  const std::string_view page = kLanguagePage;
  for (std::size_t at = 0; at < page.size();) {
    const std::size_t end = std::min(page.find('\n', at), page.size());
    const std::string_view line = page.substr(at, end - at);
    at = end + 1;
    if (!line.starts_with("| `")) continue;
    std::size_t column = 1;
    while (column < line.size() && !(line[column] == '|' && line[column - 1] != '\\')) ++column;
    std::set<std::string> names;
    const std::string_view first = line.substr(0, column);
    for (std::size_t tick = first.find('`'); tick != first.npos;) {
      const std::size_t close = first.find('`', tick + 1);
      if (close == first.npos) break;
      collect_names(first.substr(tick + 1, close - tick - 1), names);
      tick = first.find('`', close + 1);
    }
    std::string text(line.substr(2, column - 2));
    std::string meaning(column < line.size() ? line.substr(column + 1) : "");
    while (!meaning.empty() && (meaning.back() == '|' || meaning.back() == ' ')) meaning.pop_back();
    if (meaning.find_first_not_of(' ') != std::string::npos) text += "\n\n" + meaning;
    for (const std::string& name : names) rows.try_emplace(name, text);
  }
  return rows;
}

std::string argument_count(const compiler::Builtin& builtin) {
  const int low = builtin.min_arguments, high = builtin.max_arguments;
  if (high == 0) return "without arguments";
  if (high == compiler::kVariadic) return "with " + std::to_string(low) + " or more arguments";
  const std::string noun = high == 1 ? " argument" : " arguments";
  return "with " + (low == high ? std::to_string(low) : std::to_string(low) + " to " + std::to_string(high)) +
         noun;
}

}  // namespace

std::string instruction_page(std::string_view name) {
  static const auto rows = read_rows();
  std::string text;
  if (const compiler::Builtin* const builtin = compiler::find_builtin(name)) {
    text = "`" + std::string(name) + "` " + argument_count(*builtin);
    if (builtin->op != program::Opcode::kNop) {
      const program::OpcodeInfo& info = program::opcode_info(builtin->op);
      text += "\n\nInstruction `" + std::string(info.mnemonic) + "`: " + std::string(info.description);
    }
  }
  auto row = rows.find(name);
  if (row == rows.end() && name.starts_with("core.")) row = rows.find(name.substr(5));
  if (row != rows.end()) text += (text.empty() ? "" : "\n\n") + row->second;
  return text;
}

}  // namespace apron::language_server

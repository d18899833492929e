#include "apron/syntax/MacroTable.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace apron::syntax {

MacroTable::Handle MacroTable::add(Macro macro) {
  auto& entry = macros_[{macro.name, macro.parameters.size(), !macro.result_parameter.empty()}];
  if (entry != nullptr) return entry;
  entry = std::make_shared<const Macro>(std::move(macro));
  return nullptr;
}

MacroTable::Handle MacroTable::find(const std::string& name, std::size_t arguments, bool has_result) const {
  const auto found = macros_.find({name, arguments, has_result});
  return found == macros_.end() ? nullptr : found->second;
}

bool MacroTable::contains(const std::string& name) const {
  const auto next = macros_.lower_bound({name, 0, false});
  return next != macros_.end() && std::get<0>(next->first) == name;
}

bool MacroTable::has_operand_kinds(const std::string& name) const {
  for (auto it = macros_.lower_bound({name, 0, false}); it != macros_.end() && std::get<0>(it->first) == name;
       ++it) {
    const std::vector<MacroParameter>& parameters = it->second->parameters;
    if (std::ranges::any_of(parameters,
                            [](const MacroParameter& parameter) { return !parameter.kind.empty(); }))
      return true;
  }
  return false;
}

std::vector<std::string> MacroTable::signatures(const std::string& name) const {
  std::vector<std::string> list;
  for (auto it = macros_.lower_bound({name, 0, false}); it != macros_.end() && std::get<0>(it->first) == name;
       ++it) {
    list.push_back(signature(*it->second));
  }
  return list;
}

std::vector<std::string> MacroTable::names() const {
  std::vector<std::string> list;
  for (const auto& [key, macro] : macros_) {
    if (list.empty() || list.back() != macro->name) list.push_back(macro->name);
  }
  return list;
}

std::vector<MacroTable::Handle> MacroTable::all() const {
  std::vector<Handle> list;
  for (const auto& [key, macro] : macros_) list.push_back(macro);
  return list;
}

std::string signature(const Macro& macro) {
  const std::string sigil = macro.is_function ? "" : "$";
  std::string text = macro.result_parameter.empty() ? "" : sigil + macro.result_parameter;
  for (const std::string& result : macro.further_results) text += ", " + result;
  text += (text.empty() ? "" : " = ") + macro.name;
  for (std::size_t i = 0; i < macro.parameters.size(); ++i)
    text += (i == 0 ? "(" : ", ") + sigil + macro.parameters[i].name;
  return macro.parameters.empty() ? text : text + ')';
}

bool same_definition(const Macro& a, const Macro& b) {
  if (a.body.size() != b.body.size() || a.parameters != b.parameters ||
      a.result_parameter != b.result_parameter)
    return false;
  for (std::size_t i = 0; i < a.body.size(); ++i) {
    const Tokens& left = a.body[i].tokens;
    const Tokens& right = b.body[i].tokens;
    if (left.size() != right.size()) return false;
    for (std::size_t j = 0; j < left.size(); ++j) {
      if (left[j].kind != right[j].kind || left[j].text != right[j].text) return false;
    }
  }
  return true;
}

}  // namespace apron::syntax

#include "apron/compiler/Names.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "apron/syntax/Suggestion.h"
#include "apron/syntax/Token.h"

namespace apron::compiler {

Names::Names() {
  classes_["REGISTER"] = {false, {}, {}, {}};
  classes_["VARIABLE"] = {true, {}, {}, {}};
  aliases_ = {{"REGISTER", "REGISTER"}, {"r", "REGISTER"}, {"VARIABLE", "VARIABLE"}, {"v", "VARIABLE"}};
}

const Symbol* Names::find(const std::string& name) const {
  const auto found = bare_.find(name);
  return found == bare_.end() ? nullptr : &found->second;
}

void Names::add(const std::string& name, Symbol symbol) { bare_.insert_or_assign(name, std::move(symbol)); }

void Names::remove(const std::string& name) { bare_.erase(name); }

const std::string& Names::class_of(const std::string& name, syntax::Location at) const {
  const auto found = aliases_.find(name);
  if (found != aliases_.end()) return found->second;
  if (const Symbol* symbol = find(name); symbol != nullptr && symbol->value.is_register()) {
    throw Failure{
        at, fmt::format("'{0}' is a register, not a class; one cell is pixel.get({0}, x, y)", shown(name))};
  }
  std::vector<std::string> known;
  for (const auto& [alias, target] : aliases_) known.push_back(alias);
  throw Failure{at, fmt::format("there is no class '{}'{}", name, syntax::did_you_mean(name, known))};
}

bool Names::holds_variables(const std::string& class_name, syntax::Location at) const {
  return classes_.at(class_of(class_name, at)).of_variables;
}

const Symbol& Names::element(const std::string& class_name, const std::string& name,
                             syntax::Location at) const {
  const std::string& canonical = class_of(class_name, at);
  const Class& group = classes_.at(canonical);
  const auto found = group.elements.find(name);
  if (found != group.elements.end()) return found->second;
  const Symbol* bare = group.of_variables && canonical == "VARIABLE" ? find(name) : nullptr;
  if (bare != nullptr && !bare->value.is_register()) return *bare;
  std::vector<std::string> known;
  for (const std::string& one : group.order) {
    if (!is_macro_name(one)) known.push_back(one);
  }
  const std::string hint = syntax::did_you_mean(name, known);
  throw Failure{
      at, fmt::format("the class {} has no element '{}'{}", canonical, shown(name),
                      hint.empty() ? fmt::format("; create it with !create('{}', {})", shown(name), canonical)
                                   : hint)};
}

const Symbol& Names::element(const std::string& class_name, float number, syntax::Location at) const {
  const std::string& canonical = class_of(class_name, at);
  const Class& group = classes_.at(canonical);
  const bool fits =
      number >= 0.0F && number == std::floor(number) && number < static_cast<float>(group.order.size());
  if (!fits) {
    throw Failure{at, fmt::format("the class {} has {} element{}, numbered from 0; there is no number {}",
                                  canonical, group.order.size(), group.order.size() == 1 ? "" : "s", number)};
  }
  return group.elements.at(group.order[static_cast<std::size_t>(number)]);
}

void Names::add_element(const std::string& class_name, const std::string& name, Symbol symbol,
                        syntax::Location at) {
  Class& group = classes_.at(class_of(class_name, at));
  symbol.name = shown(name);
  if (!group.elements.try_emplace(name, std::move(symbol)).second) {
    throw Failure{at, fmt::format("'{}' is declared already", shown(name))};
  }
  group.order.push_back(name);
}

void Names::add_class(const syntax::Declaration& wanted) {
  for (const std::string& name : {wanted.name, wanted.alias}) {
    if (aliases_.count(name) > 0)
      throw Failure{wanted.at, fmt::format("there is a class '{}' already", name)};
  }
  classes_[wanted.name] = {wanted.of_variables, wanted.at, {}, {}};
  aliases_[wanted.name] = wanted.name;
  aliases_[wanted.alias] = wanted.name;
}

std::vector<std::uint32_t> Names::numbers(const std::string& class_name) const {
  const Class& group = classes_.at(class_name);
  std::vector<std::uint32_t> indices;
  for (const std::string& name : group.order) indices.push_back(group.elements.at(name).value.index);
  return indices;
}

std::optional<std::size_t> Names::number(const std::string& class_name, const std::string& element) const {
  const std::vector<std::string>& order = classes_.at(class_name).order;
  const auto found = std::find(order.begin(), order.end(), element);
  if (found == order.end()) return std::nullopt;
  return static_cast<std::size_t>(found - order.begin());
}

std::optional<std::size_t> Names::register_number(std::uint32_t index) const {
  for (const auto& [name, group] : classes_) {
    if (group.of_variables) continue;
    for (std::size_t i = 0; i < group.order.size(); ++i)
      if (group.elements.at(group.order[i]).value.index == index) return i;
  }
  return std::nullopt;
}

// By the shortest name of its class.
std::string Names::written_element(const std::string& class_name, const std::string& name) const {
  std::string alias = class_name;
  for (const auto& [short_name, target] : aliases_) {
    if (target == class_name && short_name.size() < alias.size()) alias = short_name;
  }
  return fmt::format("{}[{}]", alias, name);
}

std::string Names::register_element(const std::string& name) const {
  for (const auto& [class_name, group] : classes_) {
    if (!group.of_variables && group.elements.count(name) > 0) return written_element(class_name, name);
  }
  return {};
}

std::string Names::suggestion(const std::string& name, const std::vector<std::string>& also) const {
  for (const auto& [class_name, group] : classes_) {
    if (group.elements.count(name) > 0)
      return fmt::format("; did you mean '{}'?", written_element(class_name, name));
  }
  std::vector<std::string> known = also;
  for (const auto& [bare, symbol] : bare_) {
    if (!is_macro_name(bare) && symbol.value.kind != Value::Kind::kNothing) known.push_back(bare);
  }
  return syntax::did_you_mean(name, known);
}

const Symbol* Names::find_register(std::uint32_t index) const {
  for (const auto& [name, group] : classes_) {
    for (const auto& [element, symbol] : group.elements) {
      if (symbol.value.is_register() && symbol.value.index == index) return &symbol;
    }
  }
  return nullptr;
}

bool is_macro_name(const std::string& name) { return name.find(':') != std::string::npos; }

bool is_local(const std::string& name) { return is_macro_name(name) && name.front() != '$'; }

std::string shown(const std::string& name) { return syntax::written(name); }

}  // namespace apron::compiler

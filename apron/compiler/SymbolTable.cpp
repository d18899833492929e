#include "apron/compiler/SymbolTable.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "apron/syntax/Token.h"
#include "common/text/Suggestion.h"

namespace apron::compiler {

SymbolTable::SymbolTable() {
  classes_["REGISTER"] = {false, {}, {}, {}};
  classes_["VARIABLE"] = {true, {}, {}, {}};
  aliases_ = {{"REGISTER", "REGISTER"}, {"r", "REGISTER"}, {"VARIABLE", "VARIABLE"}, {"v", "VARIABLE"}};
}

const Symbol* SymbolTable::find(const std::string& name) const {
  const auto found = symbols_.find(name);
  return found == symbols_.end() ? nullptr : &found->second;
}

void SymbolTable::add(const std::string& name, Symbol symbol) {
  symbols_.insert_or_assign(name, std::move(symbol));
}

void SymbolTable::remove(const std::string& name) { symbols_.erase(name); }

const std::string& SymbolTable::resolve_class(const std::string& name, syntax::Location location) const {
  const auto found = aliases_.find(name);
  if (found != aliases_.end()) return found->second;
  if (const Symbol* symbol = find(name); symbol != nullptr && symbol->value.is_register()) {
    fail(location, "'{0}' is a register, not a class; one cell is pixel.get({0}, x, y)", display_name(name));
  }
  std::vector<std::string> known;
  for (const auto& [alias, target] : aliases_) known.push_back(alias);
  fail(location, "there is no class '{}'{}", display_name(name), common::did_you_mean(name, known));
}

bool SymbolTable::holds_variables(const std::string& class_name, syntax::Location location) const {
  return classes_.at(resolve_class(class_name, location)).of_variables;
}

const SymbolTable::ElementClass* SymbolTable::find_class(const std::string& name) const {
  const auto found = aliases_.find(name);
  return found == aliases_.end() ? nullptr : &classes_.at(found->second);
}

const Symbol* SymbolTable::find_element_or_null(const std::string& class_name,
                                                const std::string& name) const {
  const ElementClass* element_class = find_class(class_name);
  if (element_class == nullptr) return nullptr;
  const auto found = element_class->elements.find(name);
  if (found != element_class->elements.end()) return &found->second;
  // So are local names that are scalars, which have no number.
  const Symbol* bare = element_class == &classes_.at("VARIABLE") ? find(name) : nullptr;
  return bare != nullptr && !bare->value.is_register() ? bare : nullptr;
}

const Symbol* SymbolTable::find_element_or_null(const std::string& class_name, double number) const {
  const ElementClass* element_class = find_class(class_name);
  const bool in_range = element_class != nullptr && number >= 0.0 && number == std::floor(number) &&
                        number < static_cast<double>(element_class->order.size());
  if (!in_range) return nullptr;
  return &element_class->elements.at(element_class->order[static_cast<std::size_t>(number)]);
}

const Symbol& SymbolTable::find_element(const std::string& class_name, const std::string& name,
                                        syntax::Location location) const {
  const std::string& canonical = resolve_class(class_name, location);
  if (const Symbol* symbol = find_element_or_null(class_name, name)) return *symbol;
  std::vector<std::string> known;
  std::ranges::remove_copy_if(classes_.at(canonical).order, std::back_inserter(known), is_macro_name);
  const std::string hint = common::did_you_mean(name, known);
  fail(
      location, "the class {} has no element '{}'{}", canonical, display_name(name),
      hint.empty() ? fmt::format("; create it with !create('{}', {})", display_name(name), canonical) : hint);
}

const Symbol& SymbolTable::find_element(const std::string& class_name, double number,
                                        syntax::Location location) const {
  const std::string& canonical = resolve_class(class_name, location);
  if (const Symbol* symbol = find_element_or_null(class_name, number)) return *symbol;
  const std::size_t count = classes_.at(canonical).order.size();
  fail(location, "the class {} has {} element{}, numbered from 0; there is no number {}", canonical, count,
       count == 1 ? "" : "s", static_cast<float>(number));
}

void SymbolTable::add_element(const std::string& class_name, const std::string& name, Symbol symbol,
                              syntax::Location location) {
  ElementClass& group = classes_.at(resolve_class(class_name, location));
  symbol.name = display_name(name);
  if (!group.elements.try_emplace(name, std::move(symbol)).second) {
    fail(location, "'{}' is declared already", display_name(name));
  }
  group.order.push_back(name);
}

void SymbolTable::add_class(const syntax::Declaration& declaration) {
  for (const std::string& name : {declaration.name, declaration.alias}) {
    if (aliases_.count(name) > 0) fail(declaration.location, "there is a class '{}' already", name);
  }
  classes_[declaration.name] = {declaration.of_variables, declaration.location, {}, {}};
  aliases_[declaration.name] = declaration.name;
  aliases_[declaration.alias] = declaration.name;
}

void SymbolTable::add_array(const std::string& name, bool of_variables, std::vector<Symbol> elements,
                            syntax::Location location) {
  if (find(name) != nullptr || arrays_.contains(name))
    fail(location, "'{}' is declared already", display_name(name));
  if (const auto alias = aliases_.find(name); alias != aliases_.end())
    fail(location, "'{}' is a name of the class {}, whose elements are {}[…]: choose another", name,
         alias->second, name);
  ElementClass array{of_variables, location, {}, {}};
  for (std::size_t i = 0; i < elements.size(); ++i) {
    array.order.push_back(fmt::format("{}", i));
    array.elements.emplace(array.order.back(), elements[i]);
  }
  classes_[name] = std::move(array);
  aliases_[name] = name;
  arrays_[name] = std::move(elements);
}

void SymbolTable::remove_array(const std::string& name) {
  if (arrays_.erase(name) == 0) return;
  classes_.erase(name);
  aliases_.erase(name);
}

const std::vector<Symbol>* SymbolTable::find_array(const std::string& name) const {
  const auto found = arrays_.find(name);
  return found == arrays_.end() ? nullptr : &found->second;
}

std::vector<std::uint32_t> SymbolTable::element_indices(const std::string& class_name) const {
  std::vector<std::uint32_t> indices;
  for (const Symbol* element : elements(class_name)) indices.push_back(element->value.index);
  return indices;
}

std::vector<const Symbol*> SymbolTable::elements(const std::string& class_name) const {
  const ElementClass* element_class = find_class(class_name);
  std::vector<const Symbol*> all;
  for (std::size_t i = 0; element_class != nullptr && i < element_class->order.size(); ++i)
    all.push_back(&element_class->elements.at(element_class->order[i]));
  return all;
}

std::optional<std::size_t> SymbolTable::element_number(const std::string& class_name,
                                                       const std::string& element) const {
  const std::vector<std::string>& order = classes_.at(class_name).order;
  const auto found = std::ranges::find(order, element);
  if (found == order.end()) return std::nullopt;
  return found - order.begin();
}

std::optional<std::size_t> SymbolTable::register_number(std::uint32_t index) const {
  for (const auto& [name, group] : classes_) {
    if (group.of_variables) continue;
    for (std::size_t i = 0; i < group.order.size(); ++i)
      if (group.elements.at(group.order[i]).value.index == index) return i;
  }
  return std::nullopt;
}

// "r[A]", with the shortest name of the class.
std::string SymbolTable::format_element(const std::string& class_name, const std::string& name) const {
  std::string alias = class_name;
  for (const auto& [short_name, target] : aliases_) {
    if (target == class_name && short_name.size() < alias.size()) alias = short_name;
  }
  return fmt::format("{}[{}]", alias, name);
}

std::string SymbolTable::find_register_element(const std::string& name) const {
  for (const auto& [class_name, group] : classes_) {
    if (!group.of_variables && group.elements.count(name) > 0) return format_element(class_name, name);
  }
  return {};
}

std::string SymbolTable::did_you_mean(const std::string& name,
                                      const std::vector<std::string>& extra_names) const {
  for (const auto& [class_name, group] : classes_) {
    if (group.elements.count(name) > 0)
      return fmt::format("; did you mean '{}'?", format_element(class_name, name));
  }
  std::vector<std::string> known = extra_names;
  for (const auto& [bare, symbol] : symbols_) {
    if (!is_macro_name(bare) && symbol.value.kind != Value::Kind::kNone) known.push_back(bare);
  }
  return common::did_you_mean(name, known);
}

const Symbol* SymbolTable::find_register(std::uint32_t index) const {
  for (const auto& [name, group] : classes_) {
    for (const auto& [element, symbol] : group.elements) {
      if (symbol.value.is_register() && symbol.value.index == index) return &symbol;
    }
  }
  return nullptr;
}

std::string display_name(const std::string& name) { return syntax::display_name(name); }

}  // namespace apron::compiler

// The symbols of a program and what they refer to.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "apron/compiler/ProgramBuilder.h"
#include "apron/syntax/Preprocessor.h"
#include "apron/syntax/SourceManager.h"

namespace apron::compiler {

struct Symbol {
  Value value;                // kNone: its declaration has an error, which is reported
  syntax::Location location;  // of its declaration or first write
  bool is_writable = true;    // not a macro's argument
  std::string name;           // as shown to the user
  bool is_declared = false;   // by !create: reads as 0 before its first write
  // The file whose lines alone compute with it, of a `!machine_register`.
  std::optional<std::uint32_t> machine_file = std::nullopt;
};

class SymbolTable {
 public:
  SymbolTable();

  // The symbol of exactly that name, or nullptr.
  const Symbol* find(const std::string& name) const;
  void add(const std::string& name, Symbol);
  void remove(const std::string& name);

  // The element of a class, by name or number. find_element() throws a CompileError that names what is wrong.
  const Symbol* find_element_or_null(const std::string& class_name, const std::string& name) const;
  const Symbol* find_element_or_null(const std::string& class_name, double number) const;
  const Symbol& find_element(const std::string& class_name, const std::string& name, syntax::Location) const;
  const Symbol& find_element(const std::string& class_name, double number, syntax::Location) const;
  // Fail if the name is taken.
  void add_element(const std::string& class_name, const std::string& name, Symbol, syntax::Location);
  void add_class(const syntax::Declaration&);
  // The class's name. Throws a CompileError if there is no such class.
  const std::string& resolve_class(const std::string& name_or_alias, syntax::Location) const;
  // The elements so far, in order; none if there is no such class.
  std::vector<const Symbol*> elements(const std::string& class_name) const;
  std::vector<std::uint32_t> element_indices(const std::string& class_name) const;
  // Arrays: classes whose elements have numbers only.
  void add_array(const std::string& name, bool of_variables, std::vector<Symbol>, syntax::Location);
  void remove_array(const std::string& name);
  // The array's elements, or nullptr.
  const std::vector<Symbol>* find_array(const std::string& name) const;
  // The index of an element, or nullopt.
  std::optional<std::size_t> element_number(const std::string& class_name, const std::string& element) const;
  // The index of a register in its class.
  std::optional<std::size_t> register_number(std::uint32_t index) const;
  bool holds_variables(const std::string& class_name, syntax::Location) const;

  // "; did you mean 'r[A]'?" and the like, or "".
  std::string did_you_mean(const std::string& name, const std::vector<std::string>& extra_names) const;
  // "r[A]" if a class of registers has an element A, else "".
  std::string find_register_element(const std::string& name) const;
  const Symbol* find_register(std::uint32_t index) const;

 private:
  struct ElementClass {
    bool of_variables = false;
    syntax::Location location;
    std::map<std::string, Symbol> elements;
    std::vector<std::string> order;
  };
  const ElementClass* find_class(const std::string& name_or_alias) const;
  std::string format_element(const std::string& class_name, const std::string& name) const;

  std::map<std::string, Symbol> symbols_;
  std::map<std::string, ElementClass> classes_;
  std::map<std::string, std::vector<Symbol>> arrays_;
  std::map<std::string, std::string> aliases_;  // includes each class under its own name
};

// Like syntax::display_name(): without the suffix that makes a macro's local names unique.
std::string display_name(const std::string& name);
using program::is_macro_name;

}  // namespace apron::compiler

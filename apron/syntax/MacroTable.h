// The macros and functions of a program, overloaded by name, number of arguments and presence of a result.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <tuple>
#include <vector>

#include "apron/syntax/Token.h"

namespace apron::syntax {

// The arguments that a function takes for a parameter.
enum class ArgumentType : std::uint8_t {
  kAny,  // a plane or a number; of a macro: any words
  kPlane,
  kNumber,
  kInteger,  // a whole number that is known when the program is compiled
  kText,
  kRegister,  // of the caller, which the function may write
};

struct MacroParameter {
  std::string name;
  ArgumentType type = ArgumentType::kAny;
  bool is_array = false;  // an array of registers, or of numbers
  std::string kind;       // of the operands that it takes, of an `!operand_kind`; "" for any argument
  bool operator==(const MacroParameter&) const = default;
};

struct Macro {
  std::string name;
  std::string result_parameter;              // its parameter, "" for a macro without a result
  std::vector<std::string> further_results;  // of a function
  bool is_function = false;
  std::vector<MacroParameter> parameters;
  std::vector<Line> body;
  Location location;
};

class MacroTable {
 public:
  using Handle = std::shared_ptr<const Macro>;

  // Returns the existing macro of the same kind, if any, which is kept.
  Handle add(Macro);
  Handle find(const std::string& name, std::size_t arguments, bool has_result) const;
  bool contains(const std::string& name) const;
  // True if an overload states the kinds of its operands.
  bool has_operand_kinds(const std::string& name) const;
  // "f($a, $b)" or "$r = f($a)", one for each overload.
  std::vector<std::string> signatures(const std::string& name) const;
  std::vector<std::string> names() const;
  std::vector<Handle> all() const;

 private:
  std::map<std::tuple<std::string, std::size_t, bool>, Handle> macros_;
};

std::string signature(const Macro&);
bool same_definition(const Macro&, const Macro&);

}  // namespace apron::syntax

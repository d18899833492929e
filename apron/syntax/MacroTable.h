// The macros of a program, told apart by name, number of arguments and presence of a result.
#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <string>
#include <tuple>
#include <vector>

#include "apron/syntax/Token.h"

namespace apron::syntax {

struct Macro {
  std::string name;
  std::string result;  // its parameter, "" for a macro without a result
  std::vector<std::string> parameters;
  std::vector<Line> body;
  Location at;
};

class MacroTable {
 public:
  using Handle = std::shared_ptr<const Macro>;

  // The macro of that kind which was there before, if any; it stays.
  Handle add(Macro);
  Handle find(const std::string& name, std::size_t arguments, bool result) const;
  bool has(const std::string& name) const;
  // "f($a, $b)" or "$r = f($a)", one for each overload.
  std::vector<std::string> patterns(const std::string& name) const;
  std::vector<std::string> names() const;

 private:
  std::map<std::tuple<std::string, std::size_t, bool>, Handle> macros_;
};

std::string pattern(const Macro&);
bool same_body(const Macro&, const Macro&);

}  // namespace apron::syntax

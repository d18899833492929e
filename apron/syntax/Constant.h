// Constants evaluated while the source is read: operands of `!if` and sizes in `!create`.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "apron/syntax/Diagnostic.h"
#include "apron/syntax/Token.h"

namespace apron::syntax {

struct Constant {
  bool is_string = false;  // a 'text', or a name that stands for itself, to be compared by == and !=
  std::string text;
  double number = 0.0;

  bool is_true() const { return is_string || number != 0.0; }
};

// A comparison by one of < <= > >= == !=; nothing if the two cannot be compared.
std::optional<bool> compare(const Constant&, std::string_view op, const Constant&);

// Numbers, texts, names, ( ) unary - + !, * / %, + -, comparisons, && and ||. Reports what is wrong, at the
// token or else at `at`.
std::optional<Constant> evaluate_constant(const Tokens&, Location location, Diagnostics&);

}  // namespace apron::syntax

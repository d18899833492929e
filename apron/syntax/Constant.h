// Preprocessing-time constants: operands of `!if` and sizes in `!create`.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "apron/syntax/Diagnostic.h"
#include "apron/syntax/Token.h"

namespace apron::syntax {

struct Constant {
  bool is_string = false;  // a 'text', or a bare name, comparable by == and !=
  std::string text;
  double number = 0.0;
};

// Compares by one of < <= > >= == !=. Returns nullopt if the two cannot be compared.
std::optional<bool> compare(const Constant&, std::string_view op, const Constant&);

// Evaluates numbers, texts, names and all operators, which mean what they mean when the program runs.
// Reports errors at the token, or at `location` if there is none.
std::optional<Constant> evaluate_constant(const Tokens&, Location location, Diagnostics&);
// True if the tokens are a number other than 0. A text, or a name that stands for nothing, is an error.
std::optional<bool> evaluate_condition(const Tokens&, Location location, Diagnostics&);

}  // namespace apron::syntax

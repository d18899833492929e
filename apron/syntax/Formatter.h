// The canonical layout of programs: spacing, two spaces per block, aligned comments.
#pragma once

#include <string>

namespace apron::syntax {

// Changes only white space and empty lines; idempotent. Returns the text unchanged if it does not lex without
// errors or if its tokens would change. Allocates; keeps no state.
std::string format_source(const std::string& text);

}  // namespace apron::syntax

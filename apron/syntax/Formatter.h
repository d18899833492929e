// The canonical layout of programs: spacing, two blanks per block, aligned comments.
#pragma once

#include <string>

namespace apron::syntax {

// The same program with comments kept and nothing but blanks and empty lines changed; formatting the result
// again changes nothing. The text must lex without errors; if it does not, or its words would change, the
// result is the text itself. Allocates; keeps no state.
std::string format_source(const std::string& text);

}  // namespace apron::syntax

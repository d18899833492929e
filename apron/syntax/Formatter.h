// The canonical layout of programs: spacing, two spaces per block, aligned comments.
#pragma once

#include <string>
#include <string_view>

namespace apron::syntax {

// Changes only white space and empty lines; idempotent. Returns the text unchanged if it does not lex without
// errors or if its tokens would change. Allocates; keeps no state.
std::string format_source(const std::string& text);

// The layout of a text that lexes, without the check that it keeps the tokens: where it does not, the
// formatter is wrong.
std::string format_unchecked(std::string_view text);

}  // namespace apron::syntax

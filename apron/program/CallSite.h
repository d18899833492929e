// Places in the user's own text.
#pragma once

#include <cstddef>
#include <string>

#include "apron/program/Program.h"

namespace apron::program {

// "file:line: " of the instruction, or of the outermost call of the macros that it comes from; "" if unknown.
std::string format_call_site(const Program&, std::size_t instruction);

// The same of a place.
std::string format_call_site(const Program&, const SourceLocation&);

}  // namespace apron::program

// The place in the user's own text that an instruction comes from.
#pragma once

#include <cstddef>
#include <string>

#include "apron/program/Program.h"

namespace apron::program {

// "file:line: " of the instruction, or of the outermost call of the macros that it comes from; "" if unknown.
std::string format_call_site(const Program&, std::size_t instruction);

// The same of the first instruction that calls a module (an index of Program::modules).
std::string format_module_call(const Program&, std::size_t module);

}  // namespace apron::program

// Checks the bodies of macros that a program defines, used or not, by calls of each with arguments of all
// kinds.
#pragma once

#include "apron/compiler/Compiler.h"

namespace apron::compiler {

// The errors that every call of a macro has, whatever its arguments: those that do not depend on them. Macros
// that the program includes from the installed library are left out, and those that open a block which
// another one closes. The program itself must compile.
CompileResult check_macro_bodies(const CompileOptions&, syntax::FileReader&);

}  // namespace apron::compiler

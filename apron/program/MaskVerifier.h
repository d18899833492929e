// The part of verify() that tracks the mask stack through the control flow.
#pragma once

#include <string>

#include "apron/program/Program.h"

namespace apron::program {

// Returns "" if the checks pass, otherwise one line that describes the error. Checks that where, elsewhere
// and endwhere balance on every path, no routine returns with a where open, at most kMaxMaskDepth are open at
// once (including those of callers), and registers written inside a where have its shape. Operands must be in
// range.
std::string verify_masks(const Program&);

}  // namespace apron::program

// The part of verify() that tracks the mask stack through the control flow.
#pragma once

#include <string>

#include "apron/program/Program.h"

namespace apron::program {

// "" if on every path where, elsewhere and endwhere balance, no routine is left with a where still open, at
// most kMaxMaskDepth are open at once (callers included), and what is written inside a where has that where's
// shape; else one line. Operands must already be in range.
std::string verify_masks(const Program&);

}  // namespace apron::program

// Runs a verified program for a bounded number of instructions with a stub host.
#pragma once

#include "apron/program/Program.h"

namespace fuzz {

// Executes at most 2000 instructions; skips programs with large arrays or filters.
void run_bounded(apron::program::Program program);

}  // namespace fuzz

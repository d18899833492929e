// Runs a verified program for a short while beside a host that has everything.
#pragma once

#include "apron/program/Program.h"

namespace fuzz {

// At most 2000 instructions, and nothing at all of a program whose arrays or filters are large.
void run_bounded(apron::program::Program program);

}  // namespace fuzz

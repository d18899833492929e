// Which instructions a run can reach from the first one, whatever its conditions yield.
#pragma once

#include "apron/program/Program.h"

namespace apron::program {

// Whether some path from the first instruction executes this opcode. The program must pass verify().
bool can_reach(const Program&, Opcode);

// Whether the program has an instruction that senses or actuates.
bool uses_surface(const Program&);

}  // namespace apron::program

// Which instructions a run can reach from the first one, whatever its conditions yield.
#pragma once

#include <cstddef>
#include <optional>

#include "apron/program/Program.h"

namespace apron::program {

// Whether some path from the first instruction executes this opcode. The program must pass verify().
bool can_reach(const Program&, Opcode);

// Whether the program has an instruction that senses, actuates or steps.
bool uses_surface(const Program&);

// The first instruction that a run can reach and from which no path leads to surface.step or the end of the program:
// there it repeats forever and the surface waits. Empty if there is none. The program must pass verify().
std::optional<std::size_t> find_loop_without_step(const Program&);

}  // namespace apron::program

// Definite-assignment analysis: finds reads of scalars that no path can have written before.
#pragma once

#include <vector>

#include "apron/compiler/Lowering.h"
#include "apron/program/Program.h"

namespace apron::compiler {

// The reads, in the order given, whose position cannot be reached from any instruction that writes the
// scalar.
std::vector<ScalarRead> find_unassigned_reads(const program::Program&, const std::vector<ScalarRead>&);

}  // namespace apron::compiler

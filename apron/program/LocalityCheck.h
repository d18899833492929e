// Finds the instructions that a purely local array could not execute: one whose cells see only themselves,
// their own sensor and actuator, and their north, east, south and west neighbours, under one controller that
// broadcasts instructions and holds the scalars.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "apron/program/Program.h"

namespace apron::program {

// The locality of an instruction: its opcode's, except that shifts are classified by their offsets and
// filters by their size.
Locality locality(const Program&, const Instruction&) noexcept;

struct NonLocalInstruction {
  std::size_t instruction = 0;
  std::string reason;  // one line, e.g. "globalsum needs the whole array"
};

// Returned in program order; empty for a program that a local array could execute. Console and media
// instructions run on the host and are not reported. The program must pass verify().
std::vector<NonLocalInstruction> find_nonlocal_instructions(const Program&);

}  // namespace apron::program

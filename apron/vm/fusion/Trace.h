// A path through the program that is known before it runs: straight-line code, and jumps, loops and calls
// whose outcome depends only on numbers set on the path.
#pragma once

#include <cstdint>
#include <vector>

#include "apron/program/Program.h"
#include "apron/vm/DecodedInstruction.h"
#include "apron/vm/fusion/FlowAnalysis.h"

namespace apron::vm {

struct Trace {
  std::uint32_t entry = 0, exit = 0;        // the instruction to go on with
  std::vector<std::uint32_t> instructions;  // every instruction passed, in order
  std::uint32_t width = 0, height = 0;
  std::size_t array_instructions = 0;
  std::size_t mask_depth = 0, call_depth = 0;  // open at once on the way, beyond those at entry
  bool reads_entry_mask = false;  // writes something that the mask in force at entry can hold back
};

struct TraceLimits {
  std::size_t array_instructions = 400;
  std::size_t instructions = 4000;
};

// As far as instructions can be fused from `entry` on: those of one shape, with masks and calls closed again
// at the exit. masked: some mask is in force at entry. The path is empty if nothing can be fused.
Trace build_trace(const program::Program& program, const std::vector<DecodedInstruction>& decoded,
                  const FlowAnalysis& flow, std::uint32_t entry, bool masked, const TraceLimits& limits);

// Shifts further than this are not fused.
inline constexpr int kMaxFusedShift = 8;

}  // namespace apron::vm

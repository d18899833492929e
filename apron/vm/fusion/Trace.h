// A path through the program that is known before it runs: straight-line code, and jumps, loops and calls
// whose outcome depends only on numbers set on the path.
#pragma once

#include <cstdint>
#include <vector>

#include "apron/program/Program.h"
#include "apron/vm/DecodedInstruction.h"
#include "apron/vm/fusion/FilterPrediction.h"
#include "apron/vm/fusion/FlowAnalysis.h"

namespace apron::vm {

struct Trace {
  std::uint32_t entry = 0, exit = 0;        // first instruction, and the one at which execution continues
  std::vector<std::uint32_t> instructions;  // in execution order
  std::uint32_t width = 0, height = 0;
  CellType type = CellType::kFloat32;  // of all its registers
  std::size_t array_instructions = 0;
  std::size_t mask_depth = 0, call_depth = 0;  // maximum open at once, beyond those at entry
  bool reads_entry_mask = false;               // a write obeys the mask in force at entry
};

struct TraceLimits {
  std::size_t array_instructions = 400;
  std::size_t instructions = 4000;
};

// Builds the longest fusible trace from `entry`, within the limits: all arrays have one shape and type, and
// masks and calls opened in the trace are closed at its exit. `masked` means that a mask is in force at
// entry. The trace is empty if nothing can be fused. It is valid while its filters hold their predicted
// coefficients.
Trace build_trace(const program::Program& program, const std::vector<DecodedInstruction>& decoded,
                  const FlowAnalysis& flow, const FilterPrediction& filters, std::uint32_t entry, bool masked,
                  const TraceLimits& limits);

// Longer shifts are not fused.
inline constexpr int kMaxFusedShift = 8;

}  // namespace apron::vm

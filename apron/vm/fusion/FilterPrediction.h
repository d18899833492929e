// The coefficients that filters probably hold when they run, so that they can be fused before the program
// starts.
#pragma once

#include <cstdint>
#include <vector>

#include "apron/program/Program.h"
#include "apron/vm/DecodedInstruction.h"

namespace apron::vm {

// Executes the program's scalar code from its beginning, without arrays and host: to the second surface.step,
// a branch on an unknown value, or a limit. Initialisation and one turn of the main loop have run by then.
class FilterPrediction {
 public:
  // The program must be verified, and `decoded` refer to its operands in `register_file`. Allocates.
  FilterPrediction(const program::Program& program, const std::vector<DecodedInstruction>& decoded,
                   const RegisterFile& register_file);

  // The filter with its predicted coefficients; null if some are computed from unknown values.
  const program::Filter* find(std::uint32_t filter) const {
    return known_[filter] ? &filters_[filter] : nullptr;
  }

 private:
  std::vector<program::Filter> filters_;
  std::vector<bool> known_;
};

}  // namespace apron::vm

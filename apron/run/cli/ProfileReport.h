// `apron run --profile FILE`: instruction counts and times as JSON and, with a cost model, the cost on the
// processor array that it describes.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "apron/program/Program.h"
#include "apron/vm/Vm.h"

namespace apron::run {

// What an instruction costs on the array: cycles of its clock, and joules of energy.
struct InstructionCost {
  double cycles = 1.0;           // each time it runs
  double cycles_per_cell = 0.0;  // and for each cell, where the array is read or written cell by cell
  double energy_j = 0.0;         // each time
  double energy_j_per_cell = 0.0;
};

struct CostModel {
  std::string name;
  double clock_hz = 1.0;
  double idle_w = 0.0;                                  // power drawn whatever runs
  InstructionCost default_cost;                         // of instructions that the model does not name
  std::map<std::string, InstructionCost> instructions;  // by mnemonic
};

// Reads a model; nothing and one line in `wrong` if the file is not one.
std::optional<CostModel> read_cost_model(const std::string& file, std::string& error);

// One object: the program, the instructions by mnemonic and by line and each by itself with counts and
// nanoseconds, and with a model the estimates, in all and for each surface.step. `steps`: how many there
// were.
std::string profile_json(const program::Program& program, const std::vector<vm::InstructionProfile>& profile,
                         std::uint64_t frame_count, const std::optional<CostModel>& model);

}  // namespace apron::run

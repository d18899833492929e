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

// The cost of one execution of an instruction on the array: a fixed part and a part per cell of its register.
struct InstructionCost {
  double cycles = 1.0;
  double cycles_per_cell = 0.0;  // for instructions that access the array cell by cell
  double energy_j = 0.0;
  double energy_j_per_cell = 0.0;
};

struct CostModel {
  std::string name;
  double clock_hz = 1.0;
  double idle_w = 0.0;                                  // static power, watts
  InstructionCost default_cost;                         // for instructions that the model does not list
  std::map<std::string, InstructionCost> instructions;  // keyed by mnemonic
  // Instructions of the modelled machine that a library emulates by macros, keyed by macro. Each expansion
  // costs this much whenever it is entered, and the instructions inside it cost nothing.
  std::map<std::string, InstructionCost> macros;
  std::vector<std::string> frame_macros;  // each one entered is a frame, if the program has no surface.step
};

// Reads a model from a JSON file. On failure returns nullopt and sets error to one line.
std::optional<CostModel> read_cost_model(const std::string& file, std::string& error);

// One JSON object: the program, and execution counts and nanoseconds by mnemonic, by line and by instruction.
// With a model also the estimated cost, in total and per frame, and the counts of its macros. frame_count:
// completed surface.step.
std::string profile_json(const program::Program& program, const std::vector<vm::InstructionProfile>& profile,
                         std::uint64_t frame_count, const std::optional<CostModel>& model);

}  // namespace apron::run

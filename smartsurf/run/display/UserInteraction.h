// Applies the user's mouse tools to a running simulation, tick by tick.
#pragma once

#include <optional>
#include <vector>

#include "smartsurf/simulation/Simulation.h"
#include "smartsurf/view/interaction/Tools.h"

namespace smartsurf::run {

// Requests for the next tick; pull and poke act for as long as they are set.
struct InteractionRequests {
  std::optional<view::Pull> pull;
  std::optional<view::Poke> poke;
  std::vector<scene::ObjectSpec> dropped_objects;
  std::vector<view::Fault> faults;
};

class UserInteraction {
 public:
  // Call after the targets of the tick are set and before the physics. Clears the dropped objects and faults.
  // Returns whether anything was applied; the run can then not be reproduced from its recording.
  bool apply(InteractionRequests& requests, simulation::Simulation& simulation);

 private:
  // A cell with overridden targets, one per channel, and the targets to restore.
  struct CellOverride {
    int row, column;
    std::vector<float> targets, original_targets;
  };
  static CellOverride capture_targets(int row, int column, const simulation::Simulation& simulation);
  static void write_targets(const CellOverride& cell, const std::vector<float>& targets,
                            simulation::Simulation& simulation);
  bool apply_poke(const std::optional<view::Poke>& poke, simulation::Simulation& simulation);
  void apply_fault(const view::Fault& fault, simulation::Simulation& simulation);

  std::optional<CellOverride> poked_cell_;
  std::vector<CellOverride> faulty_cells_;
};

}  // namespace smartsurf::run

// Applies the user's mouse tools to a running simulation, tick by tick.
#pragma once

#include <optional>
#include <vector>

#include "smartsurf/run/Simulation.h"
#include "smartsurf/view/interaction/Tools.h"

namespace smartsurf::run {

// Wishes that wait for the next tick; pull and poke hold for as long as they are there.
struct InteractionRequests {
  std::optional<view::Pull> pull;
  std::optional<view::Poke> poke;
  std::vector<scene::ObjectSpec> dropped_objects;
  std::vector<view::Fault> faults;
};

class UserInteraction {
 public:
  // After the actuators were told what the controller wants, before the physics. Takes the drops and faults
  // out of the wishes. True when anything was done: then the run cannot be run again from its recording.
  bool apply(InteractionRequests& requests, Simulation& simulation);

 private:
  // A cell that takes these for its commands, one a channel; before: what it was told when nobody held it.
  struct CellOverride {
    int row, column;
    std::vector<float> targets, original_targets;
  };
  static CellOverride capture_targets(int row, int column, const Simulation& simulation);
  static void write_targets(const CellOverride& cell, const std::vector<float>& targets,
                            Simulation& simulation);
  bool apply_poke(const std::optional<view::Poke>& poke, Simulation& simulation);
  void apply_fault(const view::Fault& fault, Simulation& simulation);

  std::optional<CellOverride> poked_cell_;
  std::vector<CellOverride> faulty_cells_;
};

}  // namespace smartsurf::run

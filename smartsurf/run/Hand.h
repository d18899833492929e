// What a person does to a running simulation with the mouse, carried out tick by tick.
#pragma once

#include <optional>
#include <vector>

#include "smartsurf/run/Simulation.h"
#include "smartsurf/view/Tools.h"

namespace smartsurf::run {

// Wishes that wait for the next tick; pull and poke hold for as long as they are there.
struct HandWishes {
  std::optional<view::Pull> pull;
  std::optional<view::Poke> poke;
  std::vector<scene::ObjectSpec> drops;
  std::vector<view::Fault> faults;
};

class Hand {
 public:
  // After the actuators were told what the controller wants, before the physics. Takes the drops and faults
  // out of the wishes. True when anything was done: then the run cannot be run again from its recording.
  bool apply(HandWishes& wishes, Simulation& simulation);

 private:
  // A cell that takes these for its commands, one a channel; before: what it was told when nobody held it.
  struct Held {
    int row, column;
    std::vector<float> commands, before;
  };
  static Held hold_as_told(int row, int column, const Simulation& simulation);
  static void tell(const Held& cell, const std::vector<float>& commands, Simulation& simulation);
  bool hold(const std::optional<view::Poke>& poke, Simulation& simulation);
  void break_cell(const view::Fault& fault, Simulation& simulation);

  std::optional<Held> held_;
  std::vector<Held> broken_;
};

}  // namespace smartsurf::run

// A moment of a program as plain values, to be drawn while the program goes on.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "apron/debugger/Probe.h"
#include "apron/vm/Vm.h"

namespace apron::debugger {

enum class Mode : std::uint8_t {
  kHeld,  // until somebody says otherwise
  kRunning,
  kStepping,  // a step is not complete, for the surface has not answered yet
  kWalking,   // line by line
  kOver,      // ended, or failed
};

// What to copy.
struct LookRequest {
  std::optional<std::size_t> large;  // a register, all of its cells
  std::vector<std::size_t> small;    // registers, with at most small_edge columns and rows
  std::uint32_t small_edge = 96;
  std::vector<std::size_t> tiles;  // registers, with at most tile_edge columns and rows
  std::uint32_t tile_edge = 512;
  bool cell = false, profile = false;
};

// Some or all cells of a register, row by row from the north-west. Of a larger one each cell stands for a
// square of step x step, of which it is the north-western one.
struct Shot {
  std::size_t reg = 0;
  std::uint32_t width = 0, height = 0, step = 1;
  std::vector<float> cells;
};

struct Look {
  std::uint64_t program = 0;    // changes with the program
  std::size_t instruction = 0;  // the one to come
  std::uint64_t ticks = 0;      // surface.step complete
  std::optional<double> time_s, surface_tick;
  Mode mode = Mode::kHeld;
  std::optional<std::size_t> hit;  // the breakpoint that it is held at
  vm::Status status = vm::Status::kRunning;
  std::string error;             // one line; of a program that failed
  std::vector<float> variables;  // by number
  std::optional<Shot> large;
  std::vector<Shot> small, tiles;
  Cell cell;
  std::vector<Around> around;                 // of the cell, by register
  std::vector<Probe::Record> history;         // of the cell
  std::vector<vm::InstructionProfile> spent;  // by instruction
};

}  // namespace apron::debugger

// A program's state as plain values, drawn while the program continues.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "apron/debugger/Probe.h"
#include "apron/vm/Vm.h"

namespace apron::debugger {

enum class ExecutionState : std::uint8_t {
  kPaused,  // until somebody says otherwise
  kRunning,
  kStepping,  // a step is not complete, for the surface has not answered yet
  kWalking,   // line by line
  kFinished,  // ended, or failed
};

// What to copy.
struct SnapshotRequest {
  std::optional<std::size_t> full;      // a register, all of its cells
  std::vector<std::size_t> thumbnails;  // registers, with at most small_edge columns and rows
  std::uint32_t max_thumbnail_edge = 96;
  std::vector<std::size_t> tiles;  // registers, with at most tile_edge columns and rows
  std::uint32_t max_tile_edge = 512;
  bool include_probe = false, include_profile = false;
};

// Some or all cells of a register, row by row from the north-west. Of a larger one each cell stands for a
// square of step x step, of which it is the north-western one.
struct SampledRegister {
  std::size_t reg = 0;
  std::uint32_t width = 0, height = 0, stride = 1;
  std::vector<float> cells;
};

struct DebugSnapshot {
  std::uint64_t program_id = 0;  // changes with the program
  std::size_t instruction = 0;   // the one to come
  std::uint64_t ticks = 0;       // surface.step complete
  std::optional<double> time_s, surface_tick;
  ExecutionState mode = ExecutionState::kPaused;
  std::optional<std::size_t> hit;  // the breakpoint that it is held at
  vm::Status status = vm::Status::kRunning;
  std::string error;             // one line; of a program that failed
  std::vector<float> variables;  // by number
  std::optional<SampledRegister> full;
  std::vector<SampledRegister> thumbnails, tiles;
  Cell cell;
  std::vector<Neighbourhood> neighbourhoods;    // of the cell, by register
  std::vector<Probe::Record> history;           // of the cell
  std::vector<vm::InstructionProfile> profile;  // by instruction
};

}  // namespace apron::debugger

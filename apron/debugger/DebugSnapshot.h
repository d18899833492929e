// A copy of a program's state, read by the user interface while the program continues.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "apron/debugger/Probe.h"
#include "apron/vm/Vm.h"

namespace apron::debugger {

enum class ExecutionState : std::uint8_t {
  kPaused,
  kRunning,
  kStepping,  // a step is in progress; it may be waiting for the surface
  kWalking,   // stepping line by line on a timer
  kFinished,  // ended or failed
};

// The contents of a snapshot. Registers are indices into Program::registers; unknown ones are ignored.
struct SnapshotRequest {
  std::optional<std::size_t> full;      // at full resolution
  std::vector<std::size_t> thumbnails;  // at most max_thumbnail_edge columns and rows
  std::uint32_t max_thumbnail_edge = 96;
  std::vector<std::size_t> tiles;  // at most max_tile_edge columns and rows
  std::uint32_t max_tile_edge = 512;
  bool include_probe = false, include_profile = false;
};

// A register subsampled by `stride` along both axes: height x width cells, row-major, row 0 north. Each cell
// is the north-west cell of its stride x stride block.
struct SampledRegister {
  std::size_t reg = 0;
  std::uint32_t width = 0, height = 0, stride = 1;
  std::vector<float> cells;
};

struct DebugSnapshot {
  std::uint64_t program_id = 0;  // incremented when the program is replaced
  std::size_t instruction = 0;   // next to execute
  std::uint64_t ticks = 0;       // completed surface.step
  std::optional<double> time_s, surface_tick;
  ExecutionState mode = ExecutionState::kPaused;
  std::optional<std::size_t> hit;  // index of the breakpoint that paused the program
  vm::Status status = vm::Status::kRunning;
  std::string error;             // one line; empty unless the program failed
  std::vector<float> variables;  // indexed like Program::variables
  std::optional<SampledRegister> full;
  std::vector<SampledRegister> thumbnails, tiles;
  Cell cell;                                    // probed
  std::vector<Neighbourhood> neighbourhoods;    // of the probed cell, indexed by register
  std::vector<Probe::Record> history;           // of the probed cell, oldest first
  std::vector<vm::InstructionProfile> profile;  // indexed by instruction
};

}  // namespace apron::debugger

// A run with a user interface, in a window or rendered off-screen to pictures and videos, and its result.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "apron/run/host/LocalHost.h"
#include "apron/run/host/RegisterView.h"
#include "apron/run/options/CompiledProgram.h"
#include "apron/run/options/Options.h"
#include "apron/vm/Vm.h"

namespace apron::run {

struct UiRun {
  const Options& options;
  CompiledProgram compiled;
  std::uint32_t width = 0, height = 0;      // default size of registers
  LocalHost& host;                          // its waits must poll common::interrupt_flag()
  std::function<void(bool)> on_pause;       // see debugger::DebugSession
  std::function<void()> on_finish;          // in a window: the program has ended, and the window stays open
  RegisterView* shown_registers = nullptr;  // written before each answer; null: none
  // Positions of the surface's cells, as in shm_protocol::Description; empty: a regular grid.
  std::vector<std::array<float, 3>> positions = {};
  double pitch = 1.0;
};

// The result of a run, with or without a user interface.
struct RunResult {
  vm::Status status = vm::Status::kEnded;
  std::string error;        // of the program
  std::string save_error;   // of --save
  std::uint64_t ticks = 0;  // completed surface.step
  std::vector<vm::InstructionProfile> profile;
};

struct UiRunResult : RunResult {
  std::string ui_error;  // one line, such as a file that cannot be written or no OpenGL; empty for none
};

}  // namespace apron::run

// `apron run` with a user interface: in a window, or rendered off-screen for pictures.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "apron/run/cli/CompiledProgram.h"
#include "apron/run/cli/Options.h"
#include "apron/run/host/LocalHost.h"
#include "apron/vm/Vm.h"

namespace apron::run {

struct UiRun {
  const Options& options;
  CompiledProgram compiled;
  std::uint32_t width = 0, height = 0;  // default size of registers
  LocalHost& host;                      // must look at interrupt_flag() when it waits
  std::function<void(bool)> on_pause;   // see debugger::Session
};

struct UiRunResult {
  vm::Status status = vm::Status::kEnded;
  std::string error;        // of the program
  std::string ui_error;     // one line: a file that cannot be written, no OpenGL; "" for nothing
  std::uint64_t ticks = 0;  // with the next one, for --profile
  std::vector<vm::InstructionProfile> profile;
};

// "" or why nothing can be drawn here, in one line.
std::string ui_unavailable_reason(const Options& options);

// Until the person closes the window, or the program is over, or a signal comes.
UiRunResult run_with_ui(const UiRun& run);

}  // namespace apron::run

// `apron run` with a person before it: in a window, or for pictures of that window.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "apron/run/LocalHost.h"
#include "apron/run/Options.h"
#include "apron/run/ProgramFile.h"
#include "apron/vm/Vm.h"

namespace apron::run {

struct DrawnRun {
  const Options& options;
  Compiled compiled;
  std::uint32_t width = 0, height = 0;  // default size of registers
  LocalHost& host;                      // must look at interrupt_flag() when it waits
  std::function<void(bool)> on_hold;    // see debugger::Session
};

struct DrawnOutcome {
  vm::Status status = vm::Status::kEnded;
  std::string error;        // of the program
  std::string wrong;        // one line: a file that cannot be written, no OpenGL; "" for nothing
  std::uint64_t ticks = 0;  // with the next one, for --profile
  std::vector<vm::InstructionProfile> spent;
};

// "" or why nothing can be drawn here, in one line.
std::string drawing_unavailable(const Options& options);

// Until the person closes the window, or the program is over, or a signal comes.
DrawnOutcome run_drawn(const DrawnRun& run);

}  // namespace apron::run

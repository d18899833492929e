// `run --watch`: shows a register while the program runs; live on a terminal, otherwise once at the end.
#pragma once

#include <chrono>
#include <string>

#include "apron/program/Program.h"
#include "apron/run/cli/TerminalImage.h"
#include "apron/vm/Vm.h"

namespace apron::run {

// On a terminal the picture occupies the upper rows, and the program's output scrolls below it.
class TerminalMonitor {
 public:
  // name: an existing register of the VM's program. vm must outlive this. Writes to stdout.
  TerminalMonitor(const vm::Vm& vm, const std::string& name);
  ~TerminalMonitor();
  TerminalMonitor(const TerminalMonitor&) = delete;
  TerminalMonitor& operator=(const TerminalMonitor&) = delete;

  // On a terminal, draws at most 20 times per second.
  void update();
  // Draws the final state; on a terminal, moves the cursor below the picture. Does nothing when called again.
  void finish();

 private:
  using Clock = std::chrono::steady_clock;
  std::string headline() const;
  void draw();

  const vm::Vm& vm_;
  std::size_t register_ = 0;
  bool is_terminal_;
  bool screen_prepared_ = false, finished_ = false;
  TerminalSize size_;
  Clock::time_point next_draw_ = Clock::now();
};

}  // namespace apron::run

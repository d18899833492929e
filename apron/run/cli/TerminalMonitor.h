// `run --watch`: shows a register while the program runs; live on a terminal, otherwise once at the end.
#pragma once

#include <chrono>
#include <string>

#include "apron/program/Program.h"
#include "apron/run/cli/TerminalImage.h"
#include "apron/vm/Vm.h"

namespace apron::run {

// In a terminal the upper part is the picture's, and what the program prints scrolls below it.
class TerminalMonitor {
 public:
  // "" or what is wrong: no register is called that.
  static std::string unknown_register_message(const program::Program& program, const std::string& name);

  // name: a register of the VM's program, which must outlive this. Writes to stdout.
  TerminalMonitor(const vm::Vm& vm, const std::string& name);
  ~TerminalMonitor();
  TerminalMonitor(const TerminalMonitor&) = delete;
  TerminalMonitor& operator=(const TerminalMonitor&) = delete;

  // In a terminal, draws unless it did less than 1/20 s ago.
  void update();
  // Draws, and in a terminal sets the cursor below.
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

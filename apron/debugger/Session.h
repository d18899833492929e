// A program before a person: runs, holds, steps and walks it, and takes looks at it.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apron/debugger/Breakpoints.h"
#include "apron/debugger/Debugger.h"
#include "apron/debugger/Look.h"
#include "apron/debugger/Probe.h"
#include "apron/vm/Vm.h"

namespace apron::debugger {

enum class Unit : std::uint8_t { kInstruction, kLine, kTick };

// By instruction: what is one line to the person (see Listing::groups()).
using Groups = std::vector<std::uint32_t>;

// Held at first. Not thread-safe. What it is told to do is done by advance().
class Session {
 public:
  // host must outlive it. on_hold(true) is called when the program is held or over, and at once,
  // on_hold(false) when it goes on. The program must have passed verify(). Throws std::bad_alloc.
  Session(program::Program program, const vm::VmOptions& options, vm::Host& host,
          std::function<void(bool)> on_hold = {});

  void run();
  void hold();
  void step(Unit unit, Groups groups = {});
  // A line, then `period` to look at it, and so on.
  void walk(std::chrono::milliseconds period, Groups groups);
  // As before the first instruction, held or running as before. Breakpoints stay.
  void reset();
  // The same with another program, whose breakpoints must be set anew.
  void replace(program::Program program);
  void set_breakpoints(std::vector<Breakpoint> list, std::vector<program::Program> questions);
  // Over after so many surface.step.
  void limit_ticks(std::uint64_t ticks) { limit_ = ticks; }
  void watch(const Cell& cell) { probe_.watch(cell); }
  void profile(bool on);

  // Goes on until a tick is complete, the step is, or something stops it. When the stop flag of the options
  // was raised it comes back in the mode it was in, and the next call goes on.
  void advance();

  Mode mode() const noexcept { return mode_; }
  bool active() const noexcept { return mode_ != Mode::kHeld && mode_ != Mode::kOver; }
  std::chrono::milliseconds period() const noexcept { return period_; }
  vm::Status status() const noexcept { return status_; }
  std::uint64_t ticks() const noexcept { return debugger_->ticks(); }
  const vm::Vm& vm() const noexcept { return *vm_; }
  void look(const LookRequest& request, Look& look) const;

 private:
  void start();
  void enter(Mode mode);
  void settle(vm::Status status);

  program::Program program_;
  vm::VmOptions options_;
  vm::Host& host_;
  std::function<void(bool)> on_hold_;
  std::unique_ptr<vm::Vm> vm_;
  std::unique_ptr<Debugger> debugger_;
  Breakpoints breakpoints_;
  std::vector<Breakpoint> list_;
  std::vector<program::Program> questions_;
  Probe probe_;
  Mode mode_ = Mode::kHeld;
  Unit unit_ = Unit::kLine;
  Groups groups_;
  std::chrono::milliseconds period_{0};
  vm::Status status_ = vm::Status::kRunning;
  std::optional<std::uint64_t> limit_;
  std::uint64_t programs_ = 1;
  bool profiling_ = false;
};

}  // namespace apron::debugger

// An interactive debugging session: runs, pauses, steps and walks a program, and takes snapshots of it.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apron/debugger/Breakpoints.h"
#include "apron/debugger/DebugSnapshot.h"
#include "apron/debugger/Debugger.h"
#include "apron/debugger/Probe.h"
#include "apron/vm/Vm.h"

namespace apron::debugger {

enum class StepUnit : std::uint8_t { kInstruction, kLine, kTick };

// By instruction: what is one line to the person (see Listing::groups()).
using InstructionGroups = std::vector<std::uint32_t>;

// Held at first. Not thread-safe. What it is told to do is done by advance().
class DebugSession {
 public:
  // host must outlive it. on_hold(true) is called when the program is held or over, and at once,
  // on_hold(false) when it goes on. The program must have passed verify(). Throws std::bad_alloc.
  DebugSession(program::Program program, const vm::VmOptions& options, vm::Host& host,
               std::function<void(bool)> on_pause = {});

  void run();
  void pause();
  void step(StepUnit unit, InstructionGroups groups = {});
  // A line, then `period` to look at it, and so on.
  void walk(std::chrono::milliseconds period, InstructionGroups groups);
  // As before the first instruction, held or running as before. Breakpoints stay.
  void reset();
  // The same with another program, whose breakpoints must be set anew.
  void replace(program::Program program);
  void set_breakpoints(std::vector<Breakpoint> breakpoints, std::vector<program::Program> condition_programs);
  // Over after so many surface.step.
  void limit_ticks(std::uint64_t ticks) { tick_limit_ = ticks; }
  void probe_cell(const Cell& cell) { probe_.select_cell(cell); }
  void set_profiling(bool enabled);

  // Goes on until a tick is complete, the step is, or something stops it. When the stop flag of the options
  // was raised it comes back in the mode it was in, and the next call goes on.
  void advance();

  ExecutionState state() const noexcept { return state_; }
  bool active() const noexcept {
    return state_ != ExecutionState::kPaused && state_ != ExecutionState::kFinished;
  }
  std::chrono::milliseconds walk_period() const noexcept { return walk_period_; }
  vm::Status status() const noexcept { return status_; }
  std::uint64_t ticks() const noexcept { return debugger_->ticks(); }
  const vm::Vm& vm() const noexcept { return *vm_; }
  void capture_snapshot(const SnapshotRequest& request, DebugSnapshot& snapshot) const;

 private:
  void create_vm();
  void enter_state(ExecutionState state);
  void update_state(vm::Status status);

  program::Program program_;
  vm::VmOptions options_;
  vm::Host& host_;
  std::function<void(bool)> on_pause_;
  std::unique_ptr<vm::Vm> vm_;
  std::unique_ptr<Debugger> debugger_;
  Breakpoints breakpoints_;
  std::vector<Breakpoint> breakpoint_list_;
  std::vector<program::Program> condition_programs_;
  Probe probe_;
  ExecutionState state_ = ExecutionState::kPaused;
  StepUnit step_unit_ = StepUnit::kLine;
  InstructionGroups step_groups_;
  std::chrono::milliseconds walk_period_{0};
  vm::Status status_ = vm::Status::kRunning;
  std::optional<std::uint64_t> tick_limit_;
  std::uint64_t program_id_ = 1;
  bool profiling_ = false;
};

}  // namespace apron::debugger

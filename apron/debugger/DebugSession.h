// An interactive debugging session: runs, pauses, steps and walks a program, and takes snapshots of it.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "apron/debugger/Breakpoints.h"
#include "apron/debugger/DebugSnapshot.h"
#include "apron/debugger/Probe.h"
#include "apron/vm/Vm.h"

namespace apron::debugger {

enum class StepUnit : std::uint8_t { kInstruction, kLine, kTick };

// Indexed by instruction: the group executed by one line step (see Listing::groups()).
using InstructionGroups = std::vector<std::uint32_t>;

// Starts paused. Commands only change the state; advance() executes instructions. Not thread-safe.
class DebugSession {
 public:
  // program must have passed verify(); host must outlive this. on_pause(true) is called by the constructor
  // and whenever the program pauses or finishes, on_pause(false) whenever it resumes. Throws std::bad_alloc.
  DebugSession(program::Program program, const vm::VmOptions& options, vm::Host& host,
               std::function<void(bool)> on_pause = {});

  void run();
  void pause();
  void step(StepUnit unit, InstructionGroups groups = {});
  // Steps by line or tick; the driver of advance() waits `period` in between (see walk_period()).
  void walk(StepUnit unit, std::chrono::milliseconds period, InstructionGroups groups = {});
  // Restarts the program and keeps breakpoints. A running or walking session keeps running; otherwise pauses.
  void reset();
  // Like reset() with another program. Clears the breakpoints; a walking session pauses.
  void replace(program::Program program);
  void set_breakpoints(std::vector<Breakpoint> breakpoints, std::vector<program::Program> condition_programs);
  // The session finishes after this many completed surface.step.
  void limit_ticks(std::uint64_t ticks) { tick_limit_ = ticks; }
  void probe_cell(const Cell& cell) { probe_.select_cell(cell); }
  void set_profiling(bool enabled);

  // Executes until a tick or the step completes, a breakpoint is hit or the program ends; returns at once
  // unless active(). If VmOptions::stop interrupts it, the state is unchanged and the next call resumes.
  void advance();

  ExecutionState state() const noexcept { return state_; }
  bool active() const noexcept {
    return state_ != ExecutionState::kPaused && state_ != ExecutionState::kFinished;
  }
  std::chrono::milliseconds walk_period() const noexcept { return walk_period_; }
  vm::Status status() const noexcept { return status_; }
  // Completed surface.step since the program started.
  std::uint64_t ticks() const noexcept { return ticks_; }
  const vm::Vm& vm() const noexcept { return *vm_; }
  void capture_snapshot(const SnapshotRequest& request, DebugSnapshot& snapshot) const;

 private:
  void create_vm();
  // These return the VM's status: kRunning if they stopped as asked, at an instruction, a line or a
  // breakpoint.
  vm::Status count_tick(vm::Status status);
  vm::Status step_instruction();
  vm::Status run_instruction();
  vm::Status run_to_tick();
  vm::Status step_line();
  void enter_state(ExecutionState state);
  void update_state(vm::Status status);

  program::Program program_;
  vm::VmOptions options_;
  vm::Host& host_;
  std::function<void(bool)> on_pause_;
  std::unique_ptr<vm::Vm> vm_;
  Breakpoints breakpoints_;
  std::vector<Breakpoint> breakpoint_list_;
  std::vector<program::Program> condition_programs_;
  std::optional<std::size_t> hit_;  // the breakpoint that ended the last run or step
  std::uint64_t ticks_ = 0;
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

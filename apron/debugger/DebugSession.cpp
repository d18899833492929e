#include "apron/debugger/DebugSession.h"

#include <algorithm>
#include <limits>
#include <utility>

namespace apron::debugger {
namespace {

// Limits a line step, so that the user can stop a program that never leaves the line.
constexpr std::uint64_t kMaxStepInstructions = 1'000'000;

SampledRegister sample_register(const vm::Vm& vm, std::size_t reg, std::uint32_t max_edge) {
  const vm::Plane plane = vm.plane(reg);
  SampledRegister sample;
  sample.reg = reg;
  sample.stride = std::max(1U, (std::max(plane.width, plane.height) + max_edge - 1) / max_edge);
  sample.width = (plane.width + sample.stride - 1) / sample.stride;
  sample.height = (plane.height + sample.stride - 1) / sample.stride;
  sample.cells.reserve(std::size_t{sample.width} * sample.height);
  for (std::uint32_t y = 0; y < plane.height; y += sample.stride)
    for (std::uint32_t x = 0; x < plane.width; x += sample.stride)
      sample.cells.push_back(vm::cell_as_float(plane, x, y));
  return sample;
}

}  // namespace

DebugSession::DebugSession(program::Program program, const vm::VmOptions& options, vm::Host& host,
                           std::function<void(bool)> on_pause)
    : program_(std::move(program)), options_(options), host_(host), on_pause_(std::move(on_pause)) {
  options_.fusion.observed.all_named = true;
  create_vm();
  if (on_pause_) on_pause_(true);
}

void DebugSession::create_vm() {
  vm_ = std::make_unique<vm::Vm>(program_, options_, host_);
  vm_->set_profiling(profiling_);
  hit_.reset();
  ticks_ = 0;
  breakpoints_ = Breakpoints(breakpoint_list_, condition_programs_, program_, host_);
  probe_.clear();
  status_ = vm::Status::kRunning;
}

void DebugSession::enter_state(ExecutionState state) {
  const bool was_active = active();
  state_ = state;
  if (on_pause_ && was_active != active()) on_pause_(!active());
}

void DebugSession::run() {
  if (state_ == ExecutionState::kFinished) return;
  breakpoints_.rearm_conditions(*vm_);
  enter_state(ExecutionState::kRunning);
}

void DebugSession::pause() {
  if (state_ != ExecutionState::kFinished) enter_state(ExecutionState::kPaused);
}

void DebugSession::step(StepUnit unit, InstructionGroups groups) {
  if (state_ == ExecutionState::kFinished) return;
  step_unit_ = unit;
  step_groups_ = std::move(groups);
  breakpoints_.rearm_conditions(*vm_);
  enter_state(ExecutionState::kStepping);
}

void DebugSession::walk(StepUnit unit, std::chrono::milliseconds period, InstructionGroups groups) {
  step(unit, std::move(groups));
  walk_period_ = period;
  if (state_ == ExecutionState::kStepping) state_ = ExecutionState::kWalking;
}

void DebugSession::reset() {
  host_.restart();
  create_vm();
  if (state_ == ExecutionState::kFinished || state_ == ExecutionState::kStepping)
    enter_state(ExecutionState::kPaused);
}

void DebugSession::replace(program::Program program) {
  program_ = std::move(program);
  breakpoint_list_.clear();
  condition_programs_.clear();
  step_groups_.clear();
  ++program_id_;
  if (state_ == ExecutionState::kWalking) enter_state(ExecutionState::kPaused);
  reset();
}

void DebugSession::set_breakpoints(std::vector<Breakpoint> breakpoints,
                                   std::vector<program::Program> condition_programs) {
  breakpoint_list_ = std::move(breakpoints);
  condition_programs_ = std::move(condition_programs);
  breakpoints_ = Breakpoints(breakpoint_list_, condition_programs_, program_, host_);
  breakpoints_.rearm_conditions(*vm_);
  hit_.reset();
}

void DebugSession::set_profiling(bool enabled) {
  profiling_ = enabled;
  vm_->set_profiling(enabled);
}

vm::Status DebugSession::count_tick(vm::Status status) {
  if (status == vm::Status::kTick) ++ticks_;
  return status;
}

// A step continues across the end of a tick.
vm::Status DebugSession::step_instruction() {
  hit_.reset();
  const vm::Status status = run_instruction();
  return status == vm::Status::kTick ? vm::Status::kRunning : status;
}

vm::Status DebugSession::run_instruction() {
  const std::size_t last = vm_->program_counter();
  const vm::Status status = count_tick(vm_->run(1));
  if (status == vm::Status::kRunning || status == vm::Status::kTick)
    hit_ = breakpoints_.hit_by_instruction(*vm_, last);
  if (status == vm::Status::kTick && !hit_) hit_ = breakpoints_.hit_by_tick(ticks_);
  return status;
}

// Runs until a tick completes or a breakpoint is hit, at full speed unless a breakpoint needs single steps.
vm::Status DebugSession::run_to_tick() {
  hit_.reset();
  vm::Status status = vm::Status::kRunning;
  if (!breakpoints_.needs_single_steps()) {
    status = count_tick(vm_->run());
    if (status == vm::Status::kTick) hit_ = breakpoints_.hit_by_tick(ticks_);
    return status;
  }
  while (status == vm::Status::kRunning && !hit_) status = run_instruction();
  return status;
}

// Stops at the first instruction of another group, too.
vm::Status DebugSession::step_line() {
  hit_.reset();
  const auto group = [&] {
    return vm_->program_counter() < step_groups_.size() ? step_groups_[vm_->program_counter()] : 0U;
  };
  const std::uint32_t start = group();
  vm::Status status = vm::Status::kRunning;
  for (std::uint64_t n = 0; n < kMaxStepInstructions && status == vm::Status::kRunning && !hit_; ++n) {
    status = run_instruction();
    if (group() != start) break;
  }
  return status;
}

void DebugSession::advance() {
  if (!active()) return;
  const std::uint64_t previous_ticks = ticks();
  vm::Status status = vm::Status::kRunning;
  if (state_ == ExecutionState::kRunning || step_unit_ == StepUnit::kTick)
    status = run_to_tick();
  else if (step_unit_ == StepUnit::kInstruction)
    status = step_instruction();
  else
    status = step_line();
  if (ticks() != previous_ticks) probe_.record(*vm_, ticks());
  update_state(status);
}

void DebugSession::update_state(vm::Status status) {
  if (status == vm::Status::kInterrupted) return;
  status_ = status;
  const bool can_continue = status == vm::Status::kRunning || status == vm::Status::kTick;
  if (tick_limit_ && ticks() >= *tick_limit_) {
    status_ = vm::Status::kEnded;
    enter_state(ExecutionState::kFinished);
  } else if (!can_continue) {
    enter_state(ExecutionState::kFinished);
  } else if (state_ == ExecutionState::kStepping || hit_) {
    enter_state(ExecutionState::kPaused);
  }
}

void DebugSession::capture_snapshot(const SnapshotRequest& request, DebugSnapshot& snapshot) const {
  snapshot = {};
  snapshot.program_id = program_id_;
  snapshot.instruction = vm_->program_counter();
  snapshot.ticks = ticks();
  snapshot.time_s = host_.time_s();
  snapshot.surface_tick = host_.tick();
  snapshot.mode = state_;
  snapshot.hit = hit_;
  snapshot.status = status_;
  snapshot.error = vm_->error();
  for (std::size_t i = 0; i < program_.variables.size(); ++i)
    snapshot.variables.push_back(std::as_const(*vm_).variable(i));
  const auto there = [&](std::size_t reg) { return reg < program_.registers.size(); };
  if (request.full && there(*request.full))
    snapshot.full = sample_register(*vm_, *request.full, std::numeric_limits<std::uint32_t>::max() / 2);
  for (const std::size_t reg : request.thumbnails)
    if (there(reg)) snapshot.thumbnails.push_back(sample_register(*vm_, reg, request.max_thumbnail_edge));
  for (const std::size_t reg : request.tiles)
    if (there(reg)) snapshot.tiles.push_back(sample_register(*vm_, reg, request.max_tile_edge));
  snapshot.cell = probe_.cell();
  if (request.include_probe) {
    snapshot.neighbourhoods = read_neighbourhoods(*vm_, probe_.cell());
    snapshot.history = probe_.records();
  }
  if (request.include_profile) snapshot.profile = vm_->profile();
}

}  // namespace apron::debugger

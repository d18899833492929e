#include "apron/debugger/Session.h"

#include <algorithm>
#include <utility>

namespace apron::debugger {
namespace {

// So that a person can stop a program that never leaves a line.
constexpr std::uint64_t kStepBudget = 1'000'000;

Shot shot(const vm::Vm& vm, std::size_t reg, std::uint32_t edge) {
  const vm::Plane plane = vm.plane(reg);
  Shot shot;
  shot.reg = reg;
  shot.step = std::max(1U, (std::max(plane.width, plane.height) + edge - 1) / edge);
  shot.width = (plane.width + shot.step - 1) / shot.step;
  shot.height = (plane.height + shot.step - 1) / shot.step;
  shot.cells.reserve(std::size_t{shot.width} * shot.height);
  for (std::uint32_t y = 0; y < plane.height; y += shot.step)
    for (std::uint32_t x = 0; x < plane.width; x += shot.step) shot.cells.push_back(plane.row(y)[x]);
  return shot;
}

}  // namespace

Session::Session(program::Program program, const vm::VmOptions& options, vm::Host& host,
                 std::function<void(bool)> on_hold)
    : program_(std::move(program)), options_(options), host_(host), on_hold_(std::move(on_hold)) {
  options_.fusion.preserve_named_registers = true;
  start();
  if (on_hold_) on_hold_(true);
}

void Session::start() {
  debugger_.reset();
  vm_ = std::make_unique<vm::Vm>(program_, options_, host_);
  vm_->set_profiling(profiling_);
  debugger_ = std::make_unique<Debugger>(*vm_);
  breakpoints_ = Breakpoints(list_, questions_, program_, host_);
  probe_.clear();
  status_ = vm::Status::kRunning;
}

void Session::enter(Mode mode) {
  const bool was_active = active();
  mode_ = mode;
  if (on_hold_ && was_active != active()) on_hold_(!active());
}

void Session::run() {
  if (mode_ == Mode::kOver) return;
  breakpoints_.arm(*vm_);
  enter(Mode::kRunning);
}

void Session::hold() {
  if (mode_ != Mode::kOver) enter(Mode::kHeld);
}

void Session::step(Unit unit, Groups groups) {
  if (mode_ == Mode::kOver) return;
  unit_ = unit;
  groups_ = std::move(groups);
  breakpoints_.arm(*vm_);
  enter(Mode::kStepping);
}

void Session::walk(std::chrono::milliseconds period, Groups groups) {
  step(Unit::kLine, std::move(groups));
  period_ = period;
  if (mode_ == Mode::kStepping) mode_ = Mode::kWalking;
}

void Session::reset() {
  start();
  if (mode_ == Mode::kOver || mode_ == Mode::kStepping) enter(Mode::kHeld);
}

void Session::replace(program::Program program) {
  program_ = std::move(program);
  list_.clear();
  questions_.clear();
  groups_.clear();
  ++programs_;
  if (mode_ == Mode::kWalking) enter(Mode::kHeld);
  reset();
}

void Session::set_breakpoints(std::vector<Breakpoint> list, std::vector<program::Program> questions) {
  list_ = std::move(list);
  questions_ = std::move(questions);
  breakpoints_ = Breakpoints(list_, questions_, program_, host_);
  breakpoints_.arm(*vm_);
  debugger_->forget_hit();
}

void Session::profile(bool on) {
  profiling_ = on;
  vm_->set_profiling(on);
}

void Session::advance() {
  if (!active()) return;
  const std::uint64_t before = ticks();
  vm::Status status = vm::Status::kRunning;
  if (mode_ == Mode::kRunning || (mode_ == Mode::kStepping && unit_ == Unit::kTick))
    status = debugger_->run(breakpoints_);
  else if (unit_ == Unit::kInstruction)
    status = debugger_->step();
  else
    status = debugger_->step_group(groups_, breakpoints_, kStepBudget);
  if (ticks() != before) probe_.record(*vm_, ticks());
  settle(status);
}

void Session::settle(vm::Status status) {
  if (status == vm::Status::kInterrupted) return;
  status_ = status;
  const bool goes_on = status == vm::Status::kRunning || status == vm::Status::kTick;
  if (limit_ && ticks() >= *limit_) {
    status_ = vm::Status::kEnded;
    enter(Mode::kOver);
  } else if (!goes_on) {
    enter(Mode::kOver);
  } else if (mode_ == Mode::kStepping || debugger_->hit()) {
    enter(Mode::kHeld);
  }
}

void Session::look(const LookRequest& request, Look& look) const {
  look = {};
  look.program = programs_;
  look.instruction = vm_->program_counter();
  look.ticks = ticks();
  look.time_s = host_.time_s();
  look.surface_tick = host_.tick();
  look.mode = mode_;
  look.hit = debugger_->hit();
  look.status = status_;
  look.error = vm_->error();
  for (std::size_t i = 0; i < program_.variables.size(); ++i)
    look.variables.push_back(std::as_const(*vm_).variable(i));
  const auto there = [&](std::size_t reg) { return reg < program_.registers.size(); };
  if (request.large && there(*request.large))
    look.large = shot(*vm_, *request.large, std::numeric_limits<std::uint32_t>::max() / 2);
  for (const std::size_t reg : request.small)
    if (there(reg)) look.small.push_back(shot(*vm_, reg, request.small_edge));
  for (const std::size_t reg : request.tiles)
    if (there(reg)) look.tiles.push_back(shot(*vm_, reg, request.tile_edge));
  look.cell = probe_.cell();
  if (request.cell) {
    look.around = around(*vm_, probe_.cell());
    look.history = probe_.records();
  }
  if (request.profile) look.spent = vm_->profile();
}

}  // namespace apron::debugger

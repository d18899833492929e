#include "apron/debugger/Debugger.h"

#include "apron/vm/NumberFormat.h"

namespace apron::debugger {
namespace {

// Line and instruction steps continue across the end of a tick.
bool is_resumable(vm::Status status) { return status == vm::Status::kRunning || status == vm::Status::kTick; }

template <class Named>
std::optional<std::size_t> find_by_name(const std::vector<Named>& all, std::string_view name) {
  for (std::size_t i = 0; i < all.size(); ++i)
    if (all[i].name == name) return i;
  return std::nullopt;
}

}  // namespace

vm::Status Debugger::count_tick(vm::Status status) {
  if (status == vm::Status::kTick) ++ticks_;
  return status;
}

vm::Status Debugger::step_instruction() {
  const vm::Status status = count_tick(vm_.run(1));
  return is_resumable(status) ? vm::Status::kRunning : status;
}

vm::Status Debugger::run_instruction(Breakpoints& breakpoints) {
  const std::size_t last = vm_.program_counter();
  const vm::Status status = count_tick(vm_.run(1));
  if (is_resumable(status)) hit_ = breakpoints.hit_by_instruction(vm_, last);
  if (status == vm::Status::kTick && !hit_) hit_ = breakpoints.hit_by_tick(ticks_);
  return status;
}

vm::Status Debugger::run(Breakpoints& breakpoints) {
  hit_.reset();
  vm::Status status = vm::Status::kRunning;
  if (!breakpoints.needs_single_steps()) {
    status = count_tick(vm_.run());
    if (status == vm::Status::kTick) hit_ = breakpoints.hit_by_tick(ticks_);
    return status;
  }
  while (status == vm::Status::kRunning && !hit_) status = run_instruction(breakpoints);
  return status;
}

vm::Status Debugger::step_group(const std::vector<std::uint32_t>& groups, Breakpoints& breakpoints,
                                std::uint64_t budget) {
  hit_.reset();
  const auto group = [&] {
    return vm_.program_counter() < groups.size() ? groups[vm_.program_counter()] : 0U;
  };
  const std::uint32_t start = group();
  vm::Status status = vm::Status::kRunning;
  while (status == vm::Status::kRunning && !hit_ && budget-- > 0) {
    status = run_instruction(breakpoints);
    if (group() != start) break;
  }
  return status;
}

vm::Status Debugger::step_line() {
  const SourcePosition start = position();
  vm::Status status = step_instruction();
  while (status == vm::Status::kRunning && is_at(start.file, start.line)) status = step_instruction();
  return status;
}

vm::Status Debugger::run_to_line(std::string_view file, std::uint32_t line, std::uint64_t budget) {
  vm::Status status = vm::Status::kRunning;
  while (status == vm::Status::kRunning && budget-- > 0) {
    status = step_instruction();
    if (is_at(file, line)) break;
  }
  return status;
}

vm::Status Debugger::run_ticks(std::uint64_t ticks) {
  vm::Status status = vm::Status::kTick;
  while (ticks-- > 0 && status == vm::Status::kTick) status = count_tick(vm_.run());
  return status;
}

SourcePosition Debugger::position() const {
  const program::Program& program = vm_.program();
  SourcePosition position{vm_.program_counter(), {}, 0};
  if (position.instruction >= program.code.size()) return position;
  const std::uint32_t index = program.code[position.instruction].source_location;
  if (index >= program.source_locations.size()) return position;
  position.file = program.files[program.source_locations[index].file];
  position.line = program.source_locations[index].line;
  return position;
}

bool Debugger::is_at(std::string_view file, std::uint32_t line) const {
  const SourcePosition here = position();
  return here.line == line && here.file == file;
}

std::optional<vm::Plane> Debugger::find_register(std::string_view name) const {
  const auto index = find_by_name(vm_.program().registers, name);
  return index ? std::optional(vm_.plane(*index)) : std::nullopt;
}

std::optional<float> Debugger::find_variable(std::string_view name) const {
  const auto index = find_by_name(vm_.program().variables, name);
  return index ? std::optional(vm_.variable(*index)) : std::nullopt;
}

std::string Debugger::format_plane(const vm::Plane& plane) {
  std::string text;
  vm::NumberBuffer buffer;
  for (std::uint32_t y = 0; y < plane.height; ++y)
    for (std::uint32_t x = 0; x < plane.width; ++x) {
      text += vm::format_number(plane.row(y)[x], buffer);
      text += x + 1 < plane.width ? ' ' : '\n';
    }
  return text;
}

}  // namespace apron::debugger

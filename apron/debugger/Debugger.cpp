#include "apron/debugger/Debugger.h"

#include "apron/vm/NumberFormat.h"

namespace apron::debugger {
namespace {

// A tick's end is no reason to stop for what looks for a line.
bool can_go_on(vm::Status status) { return status == vm::Status::kRunning || status == vm::Status::kTick; }

template <class Named>
std::optional<std::size_t> find(const std::vector<Named>& all, std::string_view name) {
  for (std::size_t i = 0; i < all.size(); ++i)
    if (all[i].name == name) return i;
  return std::nullopt;
}

}  // namespace

vm::Status Debugger::count(vm::Status status) {
  if (status == vm::Status::kTick) ++ticks_;
  return status;
}

vm::Status Debugger::step() {
  const vm::Status status = count(vm_.run(1));
  return can_go_on(status) ? vm::Status::kRunning : status;
}

vm::Status Debugger::run_one(Breakpoints& breakpoints) {
  const std::size_t last = vm_.program_counter();
  const vm::Status status = count(vm_.run(1));
  if (can_go_on(status)) hit_ = breakpoints.met(vm_, last);
  if (status == vm::Status::kTick && !hit_) hit_ = breakpoints.met_tick(ticks_);
  return status;
}

vm::Status Debugger::run(Breakpoints& breakpoints) {
  hit_.reset();
  vm::Status status = vm::Status::kRunning;
  if (!breakpoints.fine_grained()) {
    status = count(vm_.run());
    if (status == vm::Status::kTick) hit_ = breakpoints.met_tick(ticks_);
    return status;
  }
  while (status == vm::Status::kRunning && !hit_) status = run_one(breakpoints);
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
    status = run_one(breakpoints);
    if (group() != start) break;
  }
  return status;
}

vm::Status Debugger::step_line() {
  const Place start = place();
  vm::Status status = step();
  while (status == vm::Status::kRunning && at(start.file, start.line)) status = step();
  return status;
}

vm::Status Debugger::run_to_line(std::string_view file, std::uint32_t line, std::uint64_t budget) {
  vm::Status status = vm::Status::kRunning;
  while (status == vm::Status::kRunning && budget-- > 0) {
    status = step();
    if (at(file, line)) break;
  }
  return status;
}

vm::Status Debugger::run_ticks(std::uint64_t ticks) {
  vm::Status status = vm::Status::kTick;
  while (ticks-- > 0 && status == vm::Status::kTick) status = count(vm_.run());
  return status;
}

Place Debugger::place() const {
  const program::Program& program = vm_.program();
  Place place{vm_.program_counter(), {}, 0};
  if (place.instruction >= program.code.size()) return place;
  const std::uint32_t index = program.code[place.instruction].source_location;
  if (index >= program.source_locations.size()) return place;
  place.file = program.files[program.source_locations[index].file];
  place.line = program.source_locations[index].line;
  return place;
}

bool Debugger::at(std::string_view file, std::uint32_t line) const {
  const Place here = place();
  return here.line == line && here.file == file;
}

std::optional<vm::Plane> Debugger::find_register(std::string_view name) const {
  const auto index = find(vm_.program().registers, name);
  return index ? std::optional(vm_.plane(*index)) : std::nullopt;
}

std::optional<float> Debugger::find_variable(std::string_view name) const {
  const auto index = find(vm_.program().variables, name);
  return index ? std::optional(vm_.variable(*index)) : std::nullopt;
}

std::string Debugger::text(const vm::Plane& plane) {
  std::string all;
  vm::NumberBuffer buffer;
  for (std::uint32_t y = 0; y < plane.height; ++y)
    for (std::uint32_t x = 0; x < plane.width; ++x) {
      all += vm::format_number(plane.row(y)[x], buffer);
      all += x + 1 < plane.width ? ' ' : '\n';
    }
  return all;
}

}  // namespace apron::debugger

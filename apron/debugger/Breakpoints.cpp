#include "apron/debugger/Breakpoints.h"

#include <cassert>
#include <cmath>

namespace apron::debugger {
namespace {

bool is_at(const program::Program& program, const program::SourceLocation& at, const std::string& file,
           std::uint32_t line) {
  return at.line == line && program.files[at.file] == file;
}

// True if the instruction belongs to a macro that the line uses, directly or through others.
bool is_used_by(const program::Program& program, std::size_t instruction, const std::string& file,
                std::uint32_t line) {
  const program::SourceLocation* at = program::find_location(program, instruction);
  while (at != nullptr && at->expansion != 0) {
    at = &program.expansions[at->expansion].call_site;
    if (is_at(program, *at, file, line)) return true;
  }
  return false;
}

bool is_true(const std::optional<double>& value) { return value && *value != 0.0; }

bool is_same(const std::optional<double>& a, const std::optional<double>& b) {
  return a == b || (a && b && std::isnan(*a) && std::isnan(*b));
}

}  // namespace

std::string cell_expression(const std::string& name, std::uint64_t column, std::uint64_t row) {
  return "pixel.get(" + name + ", " + std::to_string(column) + ", " + std::to_string(row) + ")";
}

std::vector<std::size_t> instructions_of_line(const program::Program& program, const std::string& file,
                                              std::uint32_t line) {
  std::vector<std::size_t> own, first_of_macros;
  bool was_used = false;
  for (std::size_t i = 0; i < program.code.size(); ++i) {
    const program::SourceLocation* const at = program::find_location(program, i);
    if (at != nullptr && is_at(program, *at, file, line)) own.push_back(i);
    const bool is_used = is_used_by(program, i, file, line);
    if (is_used && !was_used) first_of_macros.push_back(i);
    was_used = is_used;
  }
  return own.empty() ? first_of_macros : own;
}

Breakpoints::Breakpoints(std::vector<Breakpoint> breakpoints, std::vector<program::Program> conditions,
                         const program::Program& program, const vm::Host& host)
    : breakpoints_(std::move(breakpoints)), line_breakpoints_(program.code.size(), -1) {
  std::size_t next_condition = 0;
  for (std::size_t n = 0; n < breakpoints_.size(); ++n) {
    const Breakpoint& breakpoint = breakpoints_[n];
    if (breakpoint.kind == Breakpoint::Kind::kCondition) {
      assert(next_condition < conditions.size());
      program::Program& condition = conditions[next_condition++];
      if (breakpoint.enabled) conditions_.push_back({n, Condition(std::move(condition), program, host)});
    }
    if (!breakpoint.enabled || breakpoint.kind == Breakpoint::Kind::kTick) continue;
    needs_single_steps_ = true;
    if (breakpoint.kind != Breakpoint::Kind::kLine) continue;
    for (const std::size_t i : instructions_of_line(program, breakpoint.file, breakpoint.line))
      line_breakpoints_[i] = static_cast<std::int32_t>(n);
  }
}

void Breakpoints::rearm_conditions(const vm::Vm& vm) {
  for (ConditionBreakpoint& entry : conditions_) entry.before = entry.condition.evaluate(vm);
}

std::optional<std::size_t> Breakpoints::hit_by_instruction(const vm::Vm& vm, std::size_t last) {
  const program::Program& program = vm.program();
  std::optional<std::size_t> found;
  for (ConditionBreakpoint& entry : conditions_) {
    if (!entry.condition.depends_on(program.code[last])) continue;
    const std::optional<double> value = entry.condition.evaluate(vm);
    const bool hit = breakpoints_[entry.index].on_change ? !is_same(value, entry.before)
                                                         : is_true(value) && !is_true(entry.before);
    if (hit) found = entry.index;
    entry.before = value;
  }
  if (found) return found;
  const std::size_t next = vm.program_counter();
  if (next >= line_breakpoints_.size() || line_breakpoints_[next] < 0) return std::nullopt;
  // A line compiles to several instructions. It is hit on entry from another line or macro expansion, and on
  // a backward jump within the line.
  const program::SourceLocation &here = program.source_locations[program.code[next].source_location],
                                &before = program.source_locations[program.code[last].source_location];
  const bool same_line =
      here.file == before.file && here.line == before.line && here.expansion == before.expansion;
  if (same_line && next > last) return std::nullopt;
  return line_breakpoints_[next];
}

std::optional<std::size_t> Breakpoints::hit_by_tick(std::uint64_t ticks) const noexcept {
  for (std::size_t n = 0; n < breakpoints_.size(); ++n)
    if (breakpoints_[n].enabled && breakpoints_[n].kind == Breakpoint::Kind::kTick &&
        breakpoints_[n].tick == ticks)
      return n;
  return std::nullopt;
}

}  // namespace apron::debugger

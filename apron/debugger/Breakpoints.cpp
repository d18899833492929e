#include "apron/debugger/Breakpoints.h"

#include <cassert>

namespace apron::debugger {

Breakpoints::Breakpoints(std::vector<Breakpoint> list, std::vector<program::Program> questions,
                         const program::Program& program, const vm::Host& world)
    : list_(std::move(list)), at_(program.code.size(), -1) {
  std::size_t question = 0;
  for (std::size_t n = 0; n < list_.size(); ++n) {
    const Breakpoint& one = list_[n];
    if (one.kind == Breakpoint::Kind::kCondition) {
      assert(question < questions.size());
      program::Program& asked = questions[question++];
      if (one.on) watches_.push_back({n, Condition(std::move(asked), program, world)});
    }
    if (!one.on || one.kind == Breakpoint::Kind::kTick) continue;
    fine_grained_ = true;
    if (one.kind != Breakpoint::Kind::kLine) continue;
    for (std::size_t i = 0; i < at_.size(); ++i) {
      const std::uint32_t index = program.code[i].source_location;
      if (index >= program.source_locations.size()) continue;
      const program::SourceLocation& source = program.source_locations[index];
      if (source.line == one.line && program.files[source.file] == one.file)
        at_[i] = static_cast<std::int32_t>(n);
    }
  }
}

void Breakpoints::arm(const vm::Vm& vm) {
  for (Watch& watch : watches_) watch.held = watch.condition.holds(vm);
}

std::optional<std::size_t> Breakpoints::met(const vm::Vm& vm, std::size_t last) {
  const program::Program& program = vm.program();
  std::optional<std::size_t> found;
  for (Watch& watch : watches_) {
    if (!watch.condition.depends_on(program.code[last])) continue;
    const bool holds = watch.condition.holds(vm);
    if (holds && !watch.held) found = watch.number;
    watch.held = holds;
  }
  if (found) return found;
  const std::size_t next = vm.program_counter();
  if (next >= at_.size() || at_[next] < 0) return std::nullopt;
  // A line has many instructions: it is met where another line, or another use of its macro, is left for it.
  const program::SourceLocation &here = program.source_locations[program.code[next].source_location],
                                &before = program.source_locations[program.code[last].source_location];
  const bool same =
      here.file == before.file && here.line == before.line && here.expansion == before.expansion;
  if (same && next > last) return std::nullopt;
  return static_cast<std::size_t>(at_[next]);
}

std::optional<std::size_t> Breakpoints::met_tick(std::uint64_t ticks) const noexcept {
  for (std::size_t n = 0; n < list_.size(); ++n)
    if (list_[n].on && list_[n].kind == Breakpoint::Kind::kTick && list_[n].tick == ticks) return n;
  return std::nullopt;
}

}  // namespace apron::debugger

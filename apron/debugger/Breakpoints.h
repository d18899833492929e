// Breakpoints: at a line, after a tick, or when a condition becomes true.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "apron/debugger/Condition.h"
#include "apron/vm/Vm.h"

namespace apron::debugger {

struct Breakpoint {
  enum class Kind : std::uint8_t { kLine, kTick, kCondition };
  Kind kind = Kind::kLine;
  std::string file;        // of a line, as Program::files has it
  std::uint32_t line = 0;  // from 1
  std::uint64_t tick = 0;  // stop when so many surface.step are complete
  std::string condition;   // as typed
  bool enabled = true;

  bool operator==(const Breakpoint&) const = default;
};

// Belongs to one program; numbers are indices into the list that it was made of.
class Breakpoints {
 public:
  Breakpoints() = default;
  // questions: of the conditions in their order, one each (see Condition). world must outlive this, program
  // too.
  Breakpoints(std::vector<Breakpoint> breakpoints, std::vector<program::Program> conditions,
              const program::Program& program, const vm::Host& host);

  // Whether instructions must be run one at a time to meet them.
  bool needs_single_steps() const noexcept { return needs_single_steps_; }
  // Of a condition that holds now, only its becoming true again counts.
  void rearm_conditions(const vm::Vm& vm);
  // After the instruction `last` was run: the breakpoint that this met, if any.
  std::optional<std::size_t> hit_by_instruction(const vm::Vm& vm, std::size_t last);
  // After a tick was completed: those of ticks.
  std::optional<std::size_t> hit_by_tick(std::uint64_t ticks) const noexcept;

 private:
  struct ConditionBreakpoint {
    std::size_t index = 0;
    Condition condition;
    bool was_true = false;
  };

  std::vector<Breakpoint> breakpoints_;
  std::vector<std::int32_t> line_breakpoints_;  // by instruction: the breakpoint of its line, or -1
  std::vector<ConditionBreakpoint> conditions_;
  bool needs_single_steps_ = false;
};

}  // namespace apron::debugger

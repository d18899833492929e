// Breakpoints: at a line, after a tick, when a condition becomes true, or when a value changes.
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
  std::string file = {};       // kLine: an entry of Program::files
  std::uint32_t line = 0;      // kLine: 1-based
  std::uint64_t tick = 0;      // kTick: stop after this many completed surface.step
  std::string condition = {};  // kCondition: the text the user typed
  bool on_change = false;      // kCondition: stop when its value changes, not when it becomes true
  bool enabled = true;

  bool operator==(const Breakpoint&) const = default;
};

// The value of a cell, for a condition: pixel.get(A, 3, 2).
std::string cell_expression(const std::string& name, std::uint64_t column, std::uint64_t row);

// The instructions at which a breakpoint at that line stops: its own, or, if it only uses macros, the first
// ones of these. Empty if the line compiles to nothing.
std::vector<std::size_t> instructions_of_line(const program::Program&, const std::string& file,
                                              std::uint32_t line);

// The breakpoints of one program. Breakpoints are identified by their index in the list passed to the
// constructor.
class Breakpoints {
 public:
  Breakpoints() = default;
  // conditions: one compiled program per breakpoint of kind kCondition, in list order (see Condition).
  // program and host must outlive this.
  Breakpoints(std::vector<Breakpoint> breakpoints, std::vector<program::Program> conditions,
              const program::Program& program, const vm::Host& host);

  // True if detecting a hit requires executing one instruction at a time.
  bool needs_single_steps() const noexcept { return needs_single_steps_; }
  // Conditions trigger on a false-to-true edge: one that holds now must become false first. Changes are those
  // from the values of now.
  void rearm_conditions(const vm::Vm& vm);
  // The line or condition breakpoint hit by executing the instruction `last`. Call after each instruction.
  std::optional<std::size_t> hit_by_instruction(const vm::Vm& vm, std::size_t last);
  // The tick breakpoint hit when `ticks` ticks are complete.
  std::optional<std::size_t> hit_by_tick(std::uint64_t ticks) const noexcept;

 private:
  struct ConditionBreakpoint {
    std::size_t index = 0;
    Condition condition;
    std::optional<double> before = {};
  };

  std::vector<Breakpoint> breakpoints_;
  std::vector<std::int32_t> line_breakpoints_;  // indexed by instruction: breakpoint on its line, or -1
  std::vector<ConditionBreakpoint> conditions_;
  bool needs_single_steps_ = false;
};

}  // namespace apron::debugger

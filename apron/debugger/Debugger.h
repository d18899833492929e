// Drives a VM by instruction, line or tick, and inspects it. Has no user interface.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "apron/debugger/Breakpoints.h"
#include "apron/vm/Vm.h"

namespace apron::debugger {

struct SourcePosition {
  std::size_t instruction = 0;  // the one to come
  std::string file;
  std::uint32_t line = 0;  // from 1; 0: the instruction has no place in a source
};

// Not thread-safe; the VM must outlive it. A status is the VM's: kBudget when the debugger stopped where it
// was told to and the program can go on.
class Debugger {
 public:
  explicit Debugger(vm::Vm& vm) : vm_(vm) {}

  // One instruction.
  vm::Status step_instruction();
  // Until the program comes to another source line.
  vm::Status step_line();
  // Until the program comes to the line (again, if it is there now), at most `budget` instructions.
  // `file` as Program::files has it.
  vm::Status run_to_line(std::string_view file, std::uint32_t line, std::uint64_t budget = kUnlimited);
  // Until `ticks` more surface.step are complete: then kTick.
  vm::Status run_ticks(std::uint64_t ticks);

  // Until a tick is complete (kTick) or a breakpoint is met (kBudget, or kTick with the tick that met it);
  // hit() tells which. At full speed as long as no breakpoint needs a look at every instruction.
  vm::Status run(Breakpoints& breakpoints);
  // The same until the program comes to an instruction of another group than the one to come, at most
  // `budget` instructions: then kBudget. groups: by instruction, such as the rows of a listing.
  vm::Status step_group(const std::vector<std::uint32_t>& groups, Breakpoints& breakpoints,
                        std::uint64_t budget = kUnlimited);
  // The breakpoint that ended the last call of these two, if one did.
  const std::optional<std::size_t>& hit() const noexcept { return hit_; }
  void clear_hit() noexcept { hit_.reset(); }  // the list has changed
  // surface.step completed by these two and by step().
  std::uint64_t ticks() const noexcept { return ticks_; }

  SourcePosition position() const;
  // By the name in the source; nothing if there is none of that name. The plane is live: it may be written.
  std::optional<vm::Plane> find_register(std::string_view name) const;
  std::optional<float> find_variable(std::string_view name) const;
  // One cell a number, rows divided by line ends, for a console.
  static std::string format_plane(const vm::Plane& plane);

  static constexpr std::uint64_t kUnlimited = std::numeric_limits<std::uint64_t>::max();

 private:
  bool is_at(std::string_view file, std::uint32_t line) const;
  vm::Status run_instruction(Breakpoints& breakpoints);
  vm::Status count_tick(vm::Status status);

  vm::Vm& vm_;
  std::optional<std::size_t> hit_;
  std::uint64_t ticks_ = 0;
};

}  // namespace apron::debugger

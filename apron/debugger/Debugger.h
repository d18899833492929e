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
  std::size_t instruction = 0;  // next to execute
  std::string file;
  std::uint32_t line = 0;  // 1-based; 0 if the instruction has no source location
};

// Not thread-safe; the VM must outlive it. Functions return the VM's status; kRunning means that the debugger
// stopped as requested and the program can continue.
class Debugger {
 public:
  explicit Debugger(vm::Vm& vm) : vm_(vm) {}

  vm::Status step_instruction();
  // Runs until the program reaches another source line.
  vm::Status step_line();
  // Runs until the program reaches the line (again, if it is there now), at most `budget` instructions.
  // file: an entry of Program::files.
  vm::Status run_to_line(std::string_view file, std::uint32_t line, std::uint64_t budget = kUnlimited);
  // Runs until `ticks` more surface.step are complete, and then returns kTick.
  vm::Status run_ticks(std::uint64_t ticks);

  // Runs until a tick completes (kTick) or a breakpoint is hit (kRunning, or kTick if that tick hit it); see
  // hit(). Runs at full speed unless breakpoints.needs_single_steps().
  vm::Status run(Breakpoints& breakpoints);
  // Like run(), but also stops with kRunning at the first instruction of another group, or after `budget`
  // instructions. groups: indexed by instruction, such as the rows of a listing.
  vm::Status step_group(const std::vector<std::uint32_t>& groups, Breakpoints& breakpoints,
                        std::uint64_t budget = kUnlimited);
  // The breakpoint that ended the last run() or step_group(), if any.
  const std::optional<std::size_t>& hit() const noexcept { return hit_; }
  void clear_hit() noexcept { hit_.reset(); }  // call when the breakpoint list changes
  // surface.step completed through this debugger.
  std::uint64_t ticks() const noexcept { return ticks_; }

  SourcePosition position() const;
  // By source name; nullopt if unknown. The plane refers to the VM's cells and may be written.
  std::optional<vm::Plane> find_register(std::string_view name) const;
  std::optional<float> find_variable(std::string_view name) const;
  // Numbers separated by spaces, one line per row.
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

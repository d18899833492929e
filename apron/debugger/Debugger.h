// Drives a VM one instruction, line or tick at a time and looks into it; no user interface of its own.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "apron/vm/Vm.h"

namespace apron::debugger {

struct Place {
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
  vm::Status step();
  // Until the program comes to another source line.
  vm::Status step_line();
  // Until the program comes to the line (again, if it is there now), at most `budget` instructions.
  // `file` as Program::files has it.
  vm::Status run_to_line(std::string_view file, std::uint32_t line, std::uint64_t budget = kUnlimited);
  // Until `ticks` more surface.step are complete: then kTick.
  vm::Status run_ticks(std::uint64_t ticks);

  Place place() const;
  // By the name in the source; nothing if there is none of that name. The plane is live: it may be written.
  std::optional<vm::Plane> find_register(std::string_view name) const;
  std::optional<float> find_variable(std::string_view name) const;
  // One cell a number, rows divided by line ends, for a console.
  static std::string text(const vm::Plane& plane);

  static constexpr std::uint64_t kUnlimited = std::numeric_limits<std::uint64_t>::max();

 private:
  bool at(std::string_view file, std::uint32_t line) const;

  vm::Vm& vm_;
};

}  // namespace apron::debugger

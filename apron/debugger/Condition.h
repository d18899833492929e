// A breakpoint condition over a program's registers and scalars, such as globalsum(D) > 0, evaluated without
// side effects.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "apron/vm/Vm.h"

namespace apron::debugger {

// The scalar to which a condition program writes its result before it executes surface.step and loops.
inline constexpr const char* kResultVariable = "condition.answer";

class Condition {
 public:
  // condition: a verified program. Its registers and scalars that share name and shape with those of debuggee
  // receive their values. host answers surface.time, .dt, .tick and .has; host and debuggee must outlive
  // this. Allocates a Vm.
  Condition(program::Program condition, const program::Program& debuggee, const vm::Host& host);
  ~Condition();
  Condition(Condition&&) noexcept;
  Condition& operator=(Condition&&) noexcept;

  // True if executing the instruction may change the result.
  bool depends_on(const program::Instruction&) const noexcept;
  // Nullopt if the condition fails, for example by reading a pixel outside the array. Does not allocate.
  std::optional<double> evaluate(const vm::Vm& debuggee);

 private:
  class ReadOnlyHost;
  struct IndexPair {
    std::size_t debuggee = 0, condition = 0;
  };

  std::vector<IndexPair> registers_, variables_;
  std::size_t result_ = 0;
  std::unique_ptr<ReadOnlyHost> host_;
  std::unique_ptr<vm::Vm> vm_;
};

}  // namespace apron::debugger

// A breakpoint condition over a program's registers and scalars, such as globalsum(D) > 0, evaluated without
// side effects.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "apron/vm/Vm.h"

namespace apron::debugger {

// The scalar that a question's program writes its answer to, before it comes to surface.step and goes round
// again.
inline constexpr const char* kResultVariable = "condition.answer";

class Condition {
 public:
  // `question`: a verified program whose registers and scalars of the watched program's names and shapes
  // stand for those. Allocates, as a Vm does. world: what surface.time, .dt, .tick and .has ask; it must
  // outlive this, the program that is watched too.
  Condition(program::Program condition, const program::Program& debuggee, const vm::Host& host);
  ~Condition();
  Condition(Condition&&) noexcept;
  Condition& operator=(Condition&&) noexcept;

  // Whether that instruction may change the answer.
  bool depends_on(const program::Instruction&) const noexcept;
  // Non-zero is yes. What the question itself gets wrong, such as a pixel outside the array, is no. No
  // allocation.
  bool evaluate(const vm::Vm& debuggee);

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

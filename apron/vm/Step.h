// An instruction with everything looked up that can be before the run: kernels, addresses, jump targets.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "apron/program/Program.h"
#include "apron/vm/Kernels.h"
#include "apron/vm/Plane.h"
#include "apron/vm/Shift.h"

namespace apron::vm {

enum class Action : std::uint8_t {
  kElementwise,  // register destination
  kScalar,       // element-wise on variables
  kShift,
  kMask,
  kReduce,
  kCell,
  kArray,  // neighbourhoods, filters, propagation, random, stack, indirection
  kFlow,
  kHost,
};

struct Step {
  // What an element-wise instruction needs, together: a program of a few hundred steps should stay in the
  // cache beside its registers.
  program::Opcode op = program::Opcode::kNop;
  Action action = Action::kFlow;
  bool masked = false;
  std::uint32_t target = 0;                                  // of a jump
  std::array<Kernel, 2> kernels{};                           // plain, masked
  const Plane* y = nullptr;                                  // register destination; looked up at each use,
  std::array<const Plane*, program::kMaxSources> planes{};   // and so are register sources: they may move
  std::array<const float*, program::kMaxSources> scalars{};  // sources that are variables or literals

  float* variable = nullptr;  // destination
  Offset offset{};
  Edge edge{};
  Plane scratch{};  // where a host's read goes first when a mask is on
  std::string_view text{};
  std::uint32_t table = 0;  // index of a filter, group or module
  float initial = 0.0F;     // of a parameter
};

// Where a program's operands live.
struct Storage {
  std::vector<Plane> registers;
  std::vector<float> scalars;  // variables, then literals
};

// jump.lt … unless.ge: whether the jump is taken.
bool is_conditional_jump(program::Opcode op) noexcept;
bool jumps(program::Opcode op, float a, float b) noexcept;

Step decode(const program::Program&, const program::Instruction&, Storage&, const KernelTable&);

}  // namespace apron::vm

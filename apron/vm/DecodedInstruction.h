// An instruction with kernels, addresses and jump targets resolved before the run.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "apron/program/Program.h"
#include "apron/vm/Plane.h"
#include "apron/vm/kernels/Kernels.h"
#include "apron/vm/kernels/Shift.h"

namespace apron::vm {

enum class DispatchKind : std::uint8_t {
  kElementwise,  // register destination
  kScalar,       // element-wise on variables
  kShift,
  kMask,
  kReduce,
  kCellAccess,
  kArrayOp,  // neighbourhoods, filters, propagation, random, stack, indirection
  kControlFlow,
  kHost,
};

struct DecodedInstruction {
  // What an element-wise instruction needs, together: a program of a few hundred steps should stay in the
  // cache beside its registers.
  program::Opcode op = program::Opcode::kNop;
  DispatchKind dispatch = DispatchKind::kControlFlow;
  bool masked = false;
  std::uint32_t jump_target = 0;                              // of a jump
  std::array<Kernel, 2> kernels{};                            // plain, masked
  const Plane* destination = nullptr;                         // register destination; looked up at each use,
  std::array<const Plane*, program::kMaxOperands> planes{};   // and so are register sources: they may move
  std::array<const float*, program::kMaxOperands> scalars{};  // sources that are variables or literals

  float* destination_variable = nullptr;  // destination
  Offset offset{};
  BoundaryCondition boundary{};
  Plane scratch{};  // where a host's read goes first when a mask is on
  std::string_view text{};
  std::uint32_t table_index = 0;  // index of a filter, group or module
  float default_value = 0.0F;     // of a parameter
};

// Where a program's operands live.
struct RegisterFile {
  std::vector<Plane> registers;
  std::vector<float> scalars;  // variables, then literals
};

// jump.lt … unless.ge: whether the jump is taken.
bool is_conditional_jump(program::Opcode op) noexcept;
bool is_branch_taken(program::Opcode op, float a, float b) noexcept;

DecodedInstruction decode(const program::Program&, const program::Instruction&, RegisterFile&,
                          const KernelTable&);

}  // namespace apron::vm

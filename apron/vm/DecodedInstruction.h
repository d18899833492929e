// An instruction with kernels, addresses and jump targets resolved before the run.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "apron/program/Program.h"
#include "apron/vm/Plane.h"
#include "apron/vm/kernels/KernelTable.h"
#include "apron/vm/kernels/Shift.h"

namespace apron::vm {

enum class DispatchKind : std::uint8_t {
  kElementwise,  // register destination
  kScalar,       // element-wise on variables
  kConvert,
  kShift,
  kMask,
  kReduce,
  kCellAccess,
  kArrayOp,  // neighbourhoods, filters, flood fill, random numbers, stack, group access
  kControlFlow,
  kHost,
};

struct DecodedInstruction {
  // The fields that element-wise instructions need come first and are contiguous, so that a few hundred
  // decoded instructions stay in the cache beside the registers.
  program::Opcode op = program::Opcode::kNop;
  DispatchKind dispatch = DispatchKind::kControlFlow;
  bool masked = false;
  CellType type = CellType::kFloat32;  // of the destination, or else of the first register
  std::uint32_t jump_target = 0;       // instruction index
  std::array<Kernel, 2> kernels{};     // unmasked, masked
  // Registers are referenced through pointers to their planes: double buffering exchanges the buffers.
  const Plane* destination = nullptr;
  std::array<const Plane*, program::kMaxOperands> planes{};
  std::array<const double*, program::kMaxOperands> scalars{};  // sources that are variables or literals

  double* destination_variable = nullptr;
  Offset offset{};  // shifts by literals
  bool has_variable_offset = false;
  BoundaryCondition boundary{};
  Plane scratch{}, second_scratch{};  // staging, see Vm::allocate_scratch()
  std::string_view text{};
  std::uint32_t table_index = 0;  // of the filter or module
  std::array<std::uint32_t, program::kMaxOperands> groups{};
  float default_value = 0.0F;  // parameters
};

// Storage of a program's operands.
struct RegisterFile {
  std::vector<Plane> registers;
  std::vector<double> scalars;  // variables, then literals; see program/ScalarArithmetic.h
};

// jump.lt to unless.ge.
bool is_conditional_jump(program::Opcode op) noexcept;
// True if the conditional jump `op` with operands a and b is taken.
bool is_branch_taken(program::Opcode op, double a, double b) noexcept;

// The result refers to the program, the register file and the kernel table, which must outlive it and whose
// vectors must not be resized.
DecodedInstruction decode(const program::Program&, const program::Instruction&, RegisterFile&,
                          const KernelTable&);

}  // namespace apron::vm

// AVX-512 code generation for one stage: a loop over vectors of 16 cells that computes one or more rows at
// once, with all intermediate values in registers. Loads shared by two rows are done once. Include only where
// Xbyak is available.
#pragma once

#include <xbyak/xbyak.h>

#include <cstddef>
#include <cstdint>
#include <map>
#include <vector>

#include "apron/vm/jit/StageJit.h"

namespace apron::vm {

class StageAssembler : private Xbyak::CodeGenerator {
 public:
  // Thrown if the stage needs more registers than the CPU has, or contains an unsupported operation.
  struct CannotCompile {};

  // Generates the code. `rows` is the number of rows per iteration; the number of vectors per row must be a
  // multiple of `vectors`. The stage must outlive the assembler. Throws CannotCompile or Xbyak::Error.
  StageAssembler(const Stage& stage, std::uint32_t rows, std::uint32_t vectors);
  StageAssembler(const StageAssembler&) = delete;
  StageAssembler& operator=(const StageAssembler&) = delete;

  // The rows that an iteration reads and writes, relative to its first row; one StageCall::row_start each.
  const std::vector<RowStream>& row_streams() const noexcept { return row_streams_; }
  void (*entry_point() const noexcept)(const StageCall*) { return entry_point_; }

 private:
  using Address = Xbyak::Address;
  using Opmask = Xbyak::Opmask;
  using Zmm = Xbyak::Zmm;

  // Predicates of vcmpps. With a NaN, only kNotEqual (NEQ_UQ) is true.
  enum Compare : std::uint8_t {
    kEqual = 0,
    kNotEqual = 4,
    kLess = 17,
    kLessEqual = 18,
    kGreater = 30,
    kGreaterEqual = 29
  };

  // The registers that hold a value, or -1.
  struct RegisterAssignment {
    int vector_register = -1;
    int mask_register = -1;
    std::size_t remaining_uses = 0;
  };
  // Vector registers of three adjacent vectors of a row.
  struct SlidingWindow {
    int west = -1, centre = -1, east = -1;
  };
  using LoadKey = std::pair<std::uint32_t, int>;  // row stream, dx

  // ---- the loops: StageAssembler.cpp ----
  void find_row_streams();
  void count_load_uses();
  void count_temp_uses();
  void allocate_fixed_registers();
  void allocate_windows();
  void emit_prologue();
  void emit_loops();
  void emit_vector();
  void emit_row(std::uint32_t row);
  void emit_window_restore(const SlidingWindow& start, const SlidingWindow& current);
  void emit_epilogue();
  std::uint32_t unroll_factor(std::uint32_t vectors) const;
  bool needs_boolean_constants() const;
  const Xbyak::Reg64& row_pointer(std::uint32_t row_stream) const;
  std::uint32_t row_stream(std::uint32_t stream) const {
    return row_stream_of_[current_row_ * stage_.streams.size() + stream];
  }

  // ---- registers and operands: RegisterAllocation.cpp ----
  Zmm allocate_vector();
  void evict_load();
  bool is_pinned(int vector) const;
  int allocate_mask();
  void materialize_mask(RegisterAssignment& temp);
  Address address(std::uint32_t row_stream, int cells) const;  // `cells` east of the current vector
  int load_vector(std::uint32_t row_stream, int cells);
  Zmm vector_operand(const MicroOperand& arg);
  int mask_operand(const MicroOperand& arg);
  void release_use(const MicroOperand& arg);
  void release_temporaries();
  Zmm allocate_result(RegisterAssignment& y);
  Zmm allocate_temporary();
  RegisterAssignment& constant_assignment(std::uint32_t pattern) { return constants_[pattern]; }
  Zmm constant_register(std::uint32_t pattern) const { return Zmm(constants_.at(pattern).vector_register); }
  Zmm zero_register() const { return constant_register(kZeroBits); }
  Zmm one_register() const { return constant_register(kOneBits); }
  bool is_memory_operand(const MicroOperand& arg) const;
  Address memory_operand(const MicroOperand& arg) const;
  // Calls emit() with the operand in a vector register, or with its memory operand if it has no further use.
  template <class Emit>
  void with_operand(const MicroOperand& arg, const Emit& emit) {
    if (is_memory_operand(arg))
      emit(memory_operand(arg));
    else
      emit(vector_operand(arg));
  }

  // ---- operations: InstructionSelection.cpp ----
  void emit_operation(std::size_t index);
  void emit_opcode(const MicroOp& op, RegisterAssignment& y);
  void emit_compare(const MicroOp& op, RegisterAssignment& y);
  void emit_logic(const MicroOp& op, RegisterAssignment& y);
  void emit_compound(const MicroOp& op, RegisterAssignment& y);
  void emit_unary(const MicroOp& op, RegisterAssignment& y);
  void emit_copy(const MicroOp& op, RegisterAssignment& y);
  void emit_select(const MicroOp& op, RegisterAssignment& y);
  void emit_sign(const Zmm& to, const Zmm& a);
  void emit_vcmp(const MicroOp& op, RegisterAssignment& y, Compare predicate);
  template <class Emit>
  void emit_binary(const MicroOp& op, RegisterAssignment& y, const Emit& instruction);
  template <class Emit>
  void emit_mask_logic(const MicroOp& op, RegisterAssignment& y, bool invert, const Emit& instruction);

  static constexpr std::uint32_t kZeroBits = 0, kOneBits = 0x3F800000U, kMagnitudeMask = 0x7FFFFFFFU,
                                 kSignMask = 0x80000000U;

  const Stage& stage_;
  const std::uint32_t rows_per_iteration_;
  std::vector<RowStream> row_streams_;
  std::vector<std::uint32_t> row_stream_of_;  // indexed [row of the iteration][stream]
  std::uint32_t unroll_factor_ = 1;           // vectors per iteration of the inner loop
  int displacement_bytes_ = 0;                // from the column register to the current vector
  std::uint32_t current_row_ = 0;
  std::vector<RegisterAssignment> temps_;
  std::map<LoadKey, RegisterAssignment> loads_;
  std::map<std::uint32_t, SlidingWindow> windows_;                   // by row stream
  std::map<std::uint32_t, RegisterAssignment> scalars_, constants_;  // by scalar slot, by bit pattern
  bool needs_scalar_pointer_ = false;                                // inside the loop
  std::vector<int> free_vectors_, free_masks_;
  std::vector<int> pinned_vectors_, pinned_masks_;  // in use by the current operation
  std::vector<int> temporaries_, temporary_masks_;  // released after the current operation
  void (*entry_point_)(const StageCall*) = nullptr;
};

}  // namespace apron::vm

// Code generation for one stage: a loop over vectors of 64 (AVX-512) or 32 (AVX2) bytes of cells that
// computes one or more rows at once, with intermediate values in registers. Loads shared by two rows are done
// once. Include only where Xbyak is available.
//
// AVX-512 has 32 vector registers, 8 mask registers and broadcast memory operands. AVX2 has 16 vector
// registers, which also hold truth values (all bits of a lane set or clear); constants are memory operands.
#pragma once

#include <xbyak/xbyak.h>

#include <cstddef>
#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "apron/vm/InstructionSet.h"
#include "apron/vm/Stage.h"

namespace apron::vm {

class StageAssembler : private Xbyak::CodeGenerator {
 public:
  // Thrown if several rows need more registers than the CPU has, or one row more than can be spilled.
  struct CannotCompile {};

  // Generates the code for kAvx512 or kAvx2. `rows` is the number of rows per iteration; the number of
  // columns per row must be a multiple of `vectors` times kLanes. The stage must outlive the assembler.
  // Throws CannotCompile or Xbyak::Error.
  StageAssembler(const Stage& stage, InstructionSet isa, std::uint32_t rows, std::uint32_t vectors);
  StageAssembler(const StageAssembler&) = delete;
  StageAssembler& operator=(const StageAssembler&) = delete;

  // The rows that an iteration reads and writes, relative to its first row; one StageCall::row_start each.
  const std::vector<RowStream>& row_streams() const noexcept { return row_streams_; }
  void (*entry_point() const noexcept)(const StageCall*) { return entry_point_; }

 private:
  using Address = Xbyak::Address;
  using Operand = Xbyak::Operand;
  using Opmask = Xbyak::Opmask;
  using Vector = Xbyak::Xmm;  // a ymm or zmm register: the encoder goes by the size that the object carries

  using Instruction = void (StageAssembler::*)(const Xbyak::Xmm&, const Operand&, const Operand&);

  // Predicates of vcmpps. With a NaN, only kNotEqual (NEQ_UQ) is true.
  enum Compare : std::uint8_t {
    kEqual = 0,
    kNotEqual = 4,
    kLess = 17,
    kLessEqual = 18,
    kGreater = 30,
    kGreaterEqual = 29
  };

  // The places of a value: the registers that hold it, and its slot on the stack; -1 for none. A truth value
  // is in a mask register (of AVX2: a vector register that holds a mask), and in a vector register as 0 or 1
  // if it is needed as a number.
  struct RegisterAssignment {
    int vector_register = -1;
    int mask_register = -1;
    int spill_slot = -1;
    bool spilled_mask = false;  // the slot holds a mask
    std::size_t remaining_uses = 0;
  };
  // Vector registers of a row's vector and those window_step_bytes_ west and east of it.
  struct SlidingWindow {
    int west = -1, centre = -1, east = -1;
  };
  using LoadKey = std::pair<std::uint32_t, int>;  // row stream, column_of()

  // ---- the loops: StageAssembler.cpp ----
  void find_row_streams();
  void count_load_uses();
  void count_temp_uses();
  void allocate_fixed_registers();
  void allocate_windows();
  void emit_prologue();
  void emit_loops();
  void emit_vectors_in_pairs_if_useful();
  void emit_vectors();
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
  Vector vector(int index) const {
    return has_masks_ ? Vector(Xbyak::Zmm(index)) : Vector(Xbyak::Ymm(index));
  }
  Vector allocate_vector();
  bool evict_load();
  bool evict_duplicate_mask();
  void spill_temp();
  std::uint32_t next_use(std::size_t temp) const;
  Address spill_address(int slot) const;
  void reload(RegisterAssignment& temp);
  bool is_pinned(int vector) const;
  int allocate_mask();
  void release_mask(int mask) { (has_masks_ ? free_masks_ : free_vectors_).push_back(mask); }
  void materialize_mask(RegisterAssignment& temp);
  Address address(std::uint32_t row_stream, int cells) const;  // `cells` east of the current vector
  int load_vector(std::uint32_t row_stream, int cells);
  Vector vector_operand(const MicroOperand& arg);
  int mask_operand(const MicroOperand& arg);
  void release_use(const MicroOperand& arg);
  void release_temporaries();
  void release_loaded_scalars();
  RegisterAssignment& temp_of(std::uint32_t op) { return temps_[current_vector_ * stage_.ops.size() + op]; }
  // Cells east of the first vector that are emitted together.
  int column_of(const MicroOperand& stream) const {
    return stream.dx + static_cast<int>(current_vector_) * lanes();
  }
  int lanes() const { return vector_bytes_ / cell_bytes_; }
  Vector allocate_result(RegisterAssignment& y);
  Vector allocate_temporary();
  // Calls emit() with a vector of the constant, a register or a memory operand.
  template <class Emit>
  void with_constant(std::uint32_t pattern, const Emit& emit) {
    const auto found = constants_.find(pattern);
    if (found != constants_.end() && found->second.vector_register >= 0)
      emit(vector(found->second.vector_register));
    else
      emit(ptr[rip + constant_pool_.at(pattern)]);
  }
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
  void emit_sign(const Vector& to, const Vector& a);
  template <class Emit>
  void emit_binary(const MicroOp& op, RegisterAssignment& y, const Emit& instruction);
  template <class InstructionOf>
  void emit_binary_instruction(const MicroOp& op, RegisterAssignment& y, InstructionOf instruction);
  void emit_mask_compare(int mask, const Vector& a, const Operand& b, Compare predicate);
  void emit_mask_as_number(const Vector& to, int mask);
  void emit_mask_logic(program::Opcode op, int to, int a, int b);
  void emit_mask_not(int to, int a);
  void emit_round(const Vector& to, const Vector& a, std::uint8_t mode);

  // ---- operations on integers: IntegerSelection.cpp ----
  // The form of an instruction for cells of 8, 16 or 32 bits.
  using PackedInstruction = void (StageAssembler::*)(const Xbyak::Xmm&, const Xbyak::Xmm&, const Operand&);
  PackedInstruction form(PackedInstruction bytes, PackedInstruction words,
                         PackedInstruction doublewords) const {
    return cell_bytes_ == 1 ? bytes : cell_bytes_ == 2 ? words : doublewords;
  }
  void emit_integer(const MicroOp& op, RegisterAssignment& y);
  void emit_integer_unary(const MicroOp& op, RegisterAssignment& y);
  void emit_integer_compare(const MicroOp& op, RegisterAssignment& y);
  void emit_integer_product(const Vector& to, const Vector& a, const Vector& b);
  void emit_bit_shift(const MicroOp& op, RegisterAssignment& y);
  void emit_nonzero(int mask, const Vector& a);
  void take_integer_constants();
  // The cell's bits as often as 32 bits hold them.
  std::uint32_t repeated(std::uint32_t cell) const {
    return cell_bytes_ == 1   ? (cell & 0xFFU) * 0x01010101U
           : cell_bytes_ == 2 ? (cell & 0xFFFFU) * 0x00010001U
                              : cell;
  }
  std::uint32_t one_bits() const { return is_integer_ ? repeated(1) : kOneBits; }

  static constexpr std::uint32_t kZeroBits = 0, kOneBits = 0x3F800000U, kMagnitudeMask = 0x7FFFFFFFU,
                                 kSignMask = 0x80000000U, kAllBits = 0xFFFFFFFFU;
  // Stack frame: the caller's stack pointer, the call's address, the bytes of a row and the remaining
  // iterations are kept in memory to leave the registers to row pointers. Spilled values follow.
  static constexpr int kCallerStackOffset = 0, kCallStackOffset = 8, kRowBytesStackOffset = 16,
                       kIterationsStackOffset = 24, kSpillStackOffset = 64;

  const Stage& stage_;
  const bool has_masks_;  // AVX-512
  const bool is_integer_;
  const int cell_bytes_, vector_bytes_, vector_registers_, window_step_bytes_;
  const std::uint32_t rows_per_iteration_;
  std::vector<RowStream> row_streams_;
  std::vector<std::uint32_t> row_stream_of_;            // indexed [row of the iteration][stream]
  std::uint32_t unroll_factor_ = 1;                     // vectors per iteration of the inner loop
  std::uint32_t vectors_together_ = 1;                  // for which each operation is emitted at once, 1 or 2
  int displacement_bytes_ = 0;                          // from the column register to the current vector
  std::uint32_t current_row_ = 0, current_vector_ = 0;  // of those that are emitted together
  std::uint32_t current_op_ = 0;                        // beyond the operations: the results
  std::vector<RegisterAssignment> temps_;               // see temp_of()
  std::vector<std::vector<std::uint32_t>> temp_uses_;   // by operation: those that use its value, ascending
  std::map<LoadKey, RegisterAssignment> loads_;
  std::map<std::uint32_t, SlidingWindow> windows_;                   // by row stream
  std::map<std::uint32_t, RegisterAssignment> scalars_, constants_;  // by scalar slot, by bit pattern
  bool needs_scalar_pointer_ = false;                                // inside the loop
  std::map<std::uint32_t, Xbyak::Label> constant_pool_;              // AVX2, by bit pattern
  std::vector<int> free_vectors_, free_masks_, free_spill_slots_;
  std::vector<int> pinned_vectors_, pinned_masks_;  // in use by the current operation
  std::vector<int> temporaries_, temporary_masks_;  // released after the current operation
  std::vector<std::uint32_t> loaded_scalars_;       // likewise, of all vectors
  void (*entry_point_)(const StageCall*) = nullptr;
};

template <class Emit>
void StageAssembler::emit_binary(const MicroOp& op, RegisterAssignment& y, const Emit& instruction) {
  MicroOperand first = op.operands[0], second = op.operands[1];
  const bool commutes = op.op == program::Opcode::kAdd || op.op == program::Opcode::kMul;
  // Only the second operand may be in memory.
  if (commutes && second.kind != MicroOperand::Kind::kStream && first.kind == MicroOperand::Kind::kStream)
    std::swap(first, second);
  const Vector a = vector_operand(first);
  const Vector to = allocate_result(y);
  with_operand(second, [&](const Operand& b) { instruction(to, a, b); });
}

template <class InstructionOf>
void StageAssembler::emit_binary_instruction(const MicroOp& op, RegisterAssignment& y,
                                             InstructionOf instruction) {
  emit_binary(op, y,
              [&](const Vector& to, const Vector& a, const Operand& b) { (this->*instruction)(to, a, b); });
}

}  // namespace apron::vm

// Machine code of one stage for AVX-512: a loop over vectors of 16 cells that computes them in one or more
// rows at once, with everything between loads and stores in registers. What two of those rows read is loaded
// once. Include only where Xbyak is there.
#pragma once

#include <xbyak/xbyak.h>

#include <cstddef>
#include <cstdint>
#include <map>
#include <vector>

#include "apron/vm/StageCode.h"

namespace apron::vm {

class StageAssembler : private Xbyak::CodeGenerator {
 public:
  // The stage needs more registers than there are.
  struct DoesNotFit {};

  // rows: of one turn. vectors: those in every row are a multiple of this. Throws DoesNotFit or Xbyak::Error.
  // The stage must outlive this.
  StageAssembler(const Stage& stage, std::uint32_t rows, std::uint32_t vectors);
  StageAssembler(const StageAssembler&) = delete;
  StageAssembler& operator=(const StageAssembler&) = delete;

  // The rows that it reads and writes, relative to a turn's first: one StageCall::first each.
  const std::vector<Stream>& lines() const noexcept { return lines_; }
  void (*code() const noexcept)(const StageCall*) { return code_; }

 private:
  using Address = Xbyak::Address;
  using Opmask = Xbyak::Opmask;
  using Zmm = Xbyak::Zmm;

  // Predicates of vcmpps. A NaN is true: NEQ_UQ.
  enum Compare : std::uint8_t {
    kEqual = 0,
    kNotEqual = 4,
    kLess = 17,
    kLessEqual = 18,
    kGreater = 30,
    kGreaterEqual = 29
  };

  // What a vector register holds, or where a value is.
  struct Value {
    int vector = -1;
    int mask = -1;
    std::size_t uses = 0;  // to come
  };
  // Three neighbouring vectors of a row.
  struct Rolling {
    int west = -1, own = -1, east = -1;
  };
  using LoadKey = std::pair<std::uint32_t, int>;  // line, dx

  // ---- the loops: StageAssembler.cpp ----
  void find_lines();
  void count_loads();
  void count_temps();
  void choose_fixed();
  void choose_rolling();
  void prologue();
  void turns();
  void one_vector();
  void one_row(std::uint32_t row);
  void restore(const Rolling& start, const Rolling& now);
  void epilogue();
  std::uint32_t unroll(std::uint32_t vectors) const;
  bool needs_truth() const;
  const Xbyak::Reg64& pointer(std::uint32_t line) const;
  std::uint32_t line(std::uint32_t stream) const { return line_of_[row_ * stage_.streams.size() + stream]; }

  // ---- registers and operands: StageOperands.cpp ----
  Zmm new_vector();
  void evict();
  bool pinned(int vector) const;
  int new_mask();
  void as_vector(Value& temp);
  Address address(std::uint32_t line, int cells) const;  // of a cell so many to the east
  int loaded(std::uint32_t line, int cells);
  Zmm vector(const MicroArg& arg);
  int truth(const MicroArg& arg);
  void used(const MicroArg& arg);
  void release();
  Zmm result(Value& y);
  Zmm loose();
  Value& bits(std::uint32_t pattern) { return constants_[pattern]; }
  Zmm constant(std::uint32_t pattern) const { return Zmm(constants_.at(pattern).vector); }
  Zmm zero() const { return constant(kZero); }
  Zmm one() const { return constant(kOne); }
  bool in_memory(const MicroArg& arg) const;
  Address place(const MicroArg& arg) const;
  // emit(the operand as a vector, or as the memory where it lies if nobody needs it again).
  template <class Emit>
  void with_operand(const MicroArg& arg, const Emit& emit) {
    if (in_memory(arg))
      emit(place(arg));
    else
      emit(vector(arg));
  }

  // ---- one operation each: StageOperations.cpp ----
  void operation(std::size_t index);
  void emit(const MicroOp& op, Value& y);
  void emit_compare(const MicroOp& op, Value& y);
  void emit_logic(const MicroOp& op, Value& y);
  void emit_more(const MicroOp& op, Value& y);
  void emit_unary(const MicroOp& op, Value& y);
  void emit_copy(const MicroOp& op, Value& y);
  void emit_select(const MicroOp& op, Value& y);
  void emit_sign(const Zmm& to, const Zmm& a);
  void compare(const MicroOp& op, Value& y, Compare predicate);
  template <class Emit>
  void binary(const MicroOp& op, Value& y, const Emit& instruction);
  template <class Emit>
  void logic(const MicroOp& op, Value& y, bool invert, const Emit& instruction);

  static constexpr std::uint32_t kZero = 0, kOne = 0x3F800000U, kMagnitude = 0x7FFFFFFFU,
                                 kSignBit = 0x80000000U;

  const Stage& stage_;
  const std::uint32_t rows_;
  std::vector<Stream> lines_;
  std::vector<std::uint32_t> line_of_;  // by row of a turn, then stream
  std::uint32_t unroll_ = 1;            // vectors that one turn of the inner loop makes
  int ahead_ = 0;                       // bytes from the column register to the vector at hand
  std::uint32_t row_ = 0;               // at hand
  std::vector<Value> temps_;
  std::map<LoadKey, Value> loads_;
  std::map<std::uint32_t, Rolling> rolling_;  // by line
  std::map<std::uint32_t, Value> scalars_, constants_;
  bool slots_used_ = false;  // inside the loop
  std::vector<int> free_, free_masks_;
  std::vector<int> pinned_, pinned_masks_;  // by the operation at hand
  std::vector<int> loose_, loose_masks_;    // that it frees
  void (*code_)(const StageCall*) = nullptr;
};

}  // namespace apron::vm

// Instruction selection of StageAssembler for int32, uint16 and uint8, packed. Results are those of the
// kernels.
#include <algorithm>

#include "apron/vm/jit/StageAssembler.h"

namespace apron::vm {

using program::Opcode;

void StageAssembler::take_integer_constants() {
  const auto pool = [&](std::uint32_t pattern) {
    if (constants_.find(pattern) == constants_.end()) constant_pool_[pattern];
  };
  pool(kZeroBits);
  pool(kAllBits);
  pool(one_bits());
  for (const MicroOp& op : stage_.ops) {
    if (cell_bytes_ != 1) continue;
    if (op.op == Opcode::kMul || op.op == Opcode::kMac) pool(0x00FF00FFU);
    if (op.immediate < 0 || op.immediate > 7) continue;
    if (op.op == Opcode::kBitLeft) pool(repeated(0xFFU << op.immediate));
    if (op.op == Opcode::kBitRight) pool(repeated(0xFFU >> op.immediate));
  }
}

void StageAssembler::emit_integer(const MicroOp& op, RegisterAssignment& y) {
  using S = StageAssembler;
  const struct {
    Opcode opcode;
    PackedInstruction instruction;
  } kBinary[] = {{Opcode::kAdd, form(&S::vpaddb, &S::vpaddw, &S::vpaddd)},
                 {Opcode::kSub, form(&S::vpsubb, &S::vpsubw, &S::vpsubd)},
                 {Opcode::kMul, form(nullptr, &S::vpmullw, &S::vpmulld)},
                 {Opcode::kMin, form(&S::vpminub, &S::vpminuw, &S::vpminsd)},
                 {Opcode::kMax, form(&S::vpmaxub, &S::vpmaxuw, &S::vpmaxsd)},
                 {Opcode::kAddSaturated, form(&S::vpaddusb, &S::vpaddusw, nullptr)},
                 {Opcode::kSubSaturated, form(&S::vpsubusb, &S::vpsubusw, nullptr)}};
  for (const auto& [opcode, instruction] : kBinary)
    if (op.op == opcode && instruction != nullptr) return emit_binary_instruction(op, y, instruction);
  if (op.op == Opcode::kBitAnd) return emit_binary_instruction(op, y, &S::vandps);
  if (op.op == Opcode::kBitOr) return emit_binary_instruction(op, y, &S::vorps);
  if (op.op == Opcode::kBitXor) return emit_binary_instruction(op, y, &S::vxorps);
  if (op.op == Opcode::kCopy) return emit_copy(op, y);
  if (op.op >= Opcode::kLt && op.op <= Opcode::kNe) return emit_integer_compare(op, y);
  if (op.op >= Opcode::kAnd && op.op <= Opcode::kNot) return emit_logic(op, y);
  switch (op.op) {
    case Opcode::kSelect:
      return emit_select(op, y);
    case Opcode::kBitLeft:
    case Opcode::kBitRight:
      return emit_bit_shift(op, y);
    case Opcode::kMul:
    case Opcode::kMac: {
      const Vector a = vector_operand(op.operands[0]), b = vector_operand(op.operands[1]);
      const Vector to = allocate_result(y);
      emit_integer_product(to, a, b);
      if (op.op == Opcode::kMac)
        with_operand(op.operands[2],
                     [&](const Operand& c) { (this->*form(&S::vpaddb, &S::vpaddw, &S::vpaddd))(to, to, c); });
      return;
    }
    case Opcode::kClamp: {
      const Vector high = vector_operand(op.operands[2]), low = vector_operand(op.operands[1]);
      const Vector to = allocate_result(y);
      with_operand(op.operands[0], [&](const Operand& a) {
        (this->*form(&S::vpminub, &S::vpminuw, &S::vpminsd))(to, high, a);
      });
      return (this->*form(&S::vpmaxub, &S::vpmaxuw, &S::vpmaxsd))(to, low, to);
    }
    default:
      return emit_integer_unary(op, y);
  }
}

void StageAssembler::emit_integer_unary(const MicroOp& op, RegisterAssignment& y) {
  using S = StageAssembler;
  const bool is_signed = cell_bytes_ == 4;
  if (op.op == Opcode::kAbs && !is_signed) return emit_copy(op, y);
  const Vector a = vector_operand(op.operands[0]);
  const Vector to = allocate_result(y);
  switch (op.op) {
    case Opcode::kAbs:
      return vpabsd(to, a);
    case Opcode::kNeg:
      vxorps(to, to, to);
      return (this->*form(&S::vpsubb, &S::vpsubw, &S::vpsubd))(to, to, a);
    case Opcode::kBitNot:
      return with_constant(kAllBits, [&](const Operand& all) { vxorps(to, a, all); });
    case Opcode::kSign:
      with_constant(one_bits(), [&](const Operand& one) {
        (this->*form(&S::vpminub, &S::vpminuw, &S::vpminsd))(to, a, one);
      });
      if (is_signed) with_constant(kAllBits, [&](const Operand& minus_one) { vpmaxsd(to, to, minus_one); });
      return;
    default:
      throw CannotCompile{};  // a quotient, or a saturated sum of 32 bits
  }
}

// Bytes: the products of the even and of the odd ones as words.
void StageAssembler::emit_integer_product(const Vector& to, const Vector& a, const Vector& b) {
  if (cell_bytes_ == 2) return vpmullw(to, a, b);
  if (cell_bytes_ == 4) return vpmulld(to, a, b);
  const Vector odd = allocate_temporary();
  vpsrlw(odd, a, 8);
  vpsrlw(to, b, 8);
  vpmullw(odd, odd, to);
  vpsllw(odd, odd, 8);
  vpmullw(to, a, b);
  with_constant(0x00FF00FFU, [&](const Operand& even) { vandps(to, to, even); });
  vorps(to, to, odd);
}

// By a distance that is known; bytes are shifted as words.
void StageAssembler::emit_bit_shift(const MicroOp& op, RegisterAssignment& y) {
  if (op.immediate < 0) throw CannotCompile{};
  const bool left = op.op == Opcode::kBitLeft;
  const Vector a = vector_operand(op.operands[0]);
  const Vector to = allocate_result(y);
  const bool is_arithmetic = cell_bytes_ == 4 && !left;
  const auto distance = static_cast<std::uint8_t>(
      std::min<std::int64_t>(op.immediate, is_arithmetic ? 31 : 8 * std::int64_t{cell_bytes_}));
  if (!is_arithmetic && distance == 8 * cell_bytes_) return vxorps(to, to, to);
  if (is_arithmetic) return vpsrad(to, a, distance);
  if (cell_bytes_ == 4) return vpslld(to, a, distance);
  if (left)
    vpsllw(to, a, distance);
  else
    vpsrlw(to, a, distance);
  if (cell_bytes_ == 1)
    with_constant(repeated(left ? 0xFFU << distance : 0xFFU >> distance),
                  [&](const Operand& kept) { vandps(to, to, kept); });
}

// AVX2 compares for equality, and signed numbers by >; unsigned ones are compared by their minimum or
// maximum.
void StageAssembler::emit_integer_compare(const MicroOp& op, RegisterAssignment& y) {
  using S = StageAssembler;
  static constexpr std::uint8_t kPredicates[] = {1, 2, 6, 5, 0, 4};  // of lt to ne
  const Vector a = vector_operand(op.operands[0]);
  if (has_masks_) {
    y.mask_register = allocate_mask();
    const std::uint8_t predicate = kPredicates[static_cast<int>(op.op) - static_cast<int>(Opcode::kLt)];
    return with_operand(op.operands[1], [&](const Operand& b) {
      const Opmask mask(y.mask_register);
      if (cell_bytes_ == 1) return vpcmpub(mask, a, b, predicate);
      if (cell_bytes_ == 2) return vpcmpuw(mask, a, b, predicate);
      vpcmpd(mask, a, b, predicate);
    });
  }
  const Vector b = vector_operand(op.operands[1]);
  y.mask_register = allocate_mask();
  const Vector to = vector(y.mask_register);
  const PackedInstruction equal = form(&S::vpcmpeqb, &S::vpcmpeqw, &S::vpcmpeqd);
  bool negated = op.op == Opcode::kNe;
  if (op.op == Opcode::kEq || op.op == Opcode::kNe) {
    (this->*equal)(to, a, b);
  } else if (cell_bytes_ == 4) {
    const bool greater = op.op == Opcode::kGt || op.op == Opcode::kLe;
    vpcmpgtd(to, greater ? a : b, greater ? b : a);
    negated = op.op == Opcode::kLe || op.op == Opcode::kGe;
  } else {
    const bool by_minimum = op.op == Opcode::kLe || op.op == Opcode::kGt;
    (this->*(by_minimum ? form(&S::vpminub, &S::vpminuw, nullptr) : form(&S::vpmaxub, &S::vpmaxuw, nullptr)))(
        to, a, b);
    (this->*equal)(to, to, a);
    negated = op.op == Opcode::kGt || op.op == Opcode::kLt;
  }
  if (negated) emit_mask_not(y.mask_register, y.mask_register);
}

void StageAssembler::emit_nonzero(int mask, const Vector& a) {
  using S = StageAssembler;
  if (has_masks_) {
    if (cell_bytes_ == 1) return vptestmb(Opmask(mask), a, a);
    if (cell_bytes_ == 2) return vptestmw(Opmask(mask), a, a);
    return vptestmd(Opmask(mask), a, a);
  }
  with_constant(kZeroBits, [&](const Operand& zero) {
    (this->*form(&S::vpcmpeqb, &S::vpcmpeqw, &S::vpcmpeqd))(vector(mask), a, zero);
  });
  emit_mask_not(mask, mask);
}

}  // namespace apron::vm

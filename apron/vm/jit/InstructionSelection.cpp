// Instruction selection of StageAssembler. Results are bit-identical to those of the kernels.
#include <utility>

#include "apron/vm/jit/StageAssembler.h"

namespace apron::vm {

using program::Opcode;

namespace {

// Immediates of vrndscaleps and vroundps: round to an integer, suppress exceptions.
constexpr std::uint8_t kRoundDown = 9, kRoundUp = 10;

}  // namespace

void StageAssembler::emit_operation(std::size_t index) {
  const MicroOp& op = stage_.ops[index];
  emit_opcode(op, temp_of(index));
  for (const MicroOperand& arg : op.operands) release_use(arg);
  release_temporaries();
}

void StageAssembler::emit_opcode(const MicroOp& op, RegisterAssignment& y) {
  if (is_integer_) return emit_integer(op, y);
  static constexpr struct {
    Opcode opcode;
    Instruction instruction;
  } kBinary[] = {{Opcode::kAdd, &StageAssembler::vaddps}, {Opcode::kSub, &StageAssembler::vsubps},
                 {Opcode::kMul, &StageAssembler::vmulps}, {Opcode::kDiv, &StageAssembler::vdivps},
                 {Opcode::kMin, &StageAssembler::vminps}, {Opcode::kMax, &StageAssembler::vmaxps}};
  for (const auto& [opcode, instruction] : kBinary)
    if (op.op == opcode) return emit_binary_instruction(op, y, instruction);
  if (op.op == Opcode::kCopy) return emit_copy(op, y);
  if (op.op >= Opcode::kLt && op.op <= Opcode::kNe) return emit_compare(op, y);
  if (op.op >= Opcode::kAnd && op.op <= Opcode::kNot) return emit_logic(op, y);
  emit_compound(op, y);
}

void StageAssembler::emit_compare(const MicroOp& op, RegisterAssignment& y) {
  static constexpr Compare kPredicates[] = {kLess,         kLessEqual, kGreater,
                                            kGreaterEqual, kEqual,     kNotEqual};  // of lt to ne
  const Compare predicate = kPredicates[static_cast<int>(op.op) - static_cast<int>(Opcode::kLt)];
  const Vector a = vector_operand(op.operands[0]);
  y.mask_register = allocate_mask();
  with_operand(op.operands[1],
               [&](const Operand& b) { emit_mask_compare(y.mask_register, a, b, predicate); });
}

void StageAssembler::emit_logic(const MicroOp& op, RegisterAssignment& y) {
  const int a = mask_operand(op.operands[0]);
  if (op.op == Opcode::kNot) {
    y.mask_register = allocate_mask();
    return emit_mask_not(y.mask_register, a);
  }
  const int b = mask_operand(op.operands[1]);
  y.mask_register = allocate_mask();
  emit_mask_logic(op.op, y.mask_register, a, b);
  if (op.op == Opcode::kNand || op.op == Opcode::kNor) emit_mask_not(y.mask_register, y.mask_register);
}

// ---- truth values: mask registers, or vectors whose lanes have all bits set or clear ----

void StageAssembler::emit_mask_compare(int mask, const Vector& a, const Operand& b, Compare predicate) {
  if (has_masks_)
    vcmpps(Opmask(mask), a, b, predicate);
  else
    vcmpps(vector(mask), a, b, predicate);
}

void StageAssembler::emit_mask_as_number(const Vector& to, int mask) {
  if (has_masks_ && is_integer_) {
    const Vector one = vector(constants_.at(one_bits()).vector_register);
    if (cell_bytes_ == 1) return vmovdqu8(to | Opmask(mask) | T_z, one);
    if (cell_bytes_ == 2) return vmovdqu16(to | Opmask(mask) | T_z, one);
    return vmovdqu32(to | Opmask(mask) | T_z, one);
  }
  if (has_masks_)
    vmovaps(to | Opmask(mask) | T_z, vector(constants_.at(kOneBits).vector_register));
  else
    with_constant(one_bits(), [&](const Operand& one) { vandps(to, vector(mask), one); });
}

void StageAssembler::emit_mask_logic(Opcode op, int to, int a, int b) {
  const bool conjunction = op == Opcode::kAnd || op == Opcode::kNand;
  if (has_masks_ && is_integer_) {  // up to 64 lanes
    if (conjunction) return kandq(Opmask(to), Opmask(a), Opmask(b));
    if (op == Opcode::kXor) return kxorq(Opmask(to), Opmask(a), Opmask(b));
    return korq(Opmask(to), Opmask(a), Opmask(b));
  }
  if (has_masks_) {
    if (conjunction) return kandw(Opmask(to), Opmask(a), Opmask(b));
    if (op == Opcode::kXor) return kxorw(Opmask(to), Opmask(a), Opmask(b));
    return korw(Opmask(to), Opmask(a), Opmask(b));
  }
  if (conjunction) return vandps(vector(to), vector(a), vector(b));
  if (op == Opcode::kXor) return vxorps(vector(to), vector(a), vector(b));
  vorps(vector(to), vector(a), vector(b));
}

void StageAssembler::emit_mask_not(int to, int a) {
  if (has_masks_ && is_integer_)
    knotq(Opmask(to), Opmask(a));
  else if (has_masks_)
    knotw(Opmask(to), Opmask(a));
  else
    with_constant(kAllBits, [&](const Operand& all) { vxorps(vector(to), vector(a), all); });
}

void StageAssembler::emit_round(const Vector& to, const Vector& a, std::uint8_t mode) {
  if (has_masks_)
    vrndscaleps(to, a, mode);
  else
    vroundps(to, a, mode);
}

void StageAssembler::emit_copy(const MicroOp& op, RegisterAssignment& y) {
  const Vector to = allocate_result(y);
  with_operand(op.operands[0], [&](const Operand& a) {
    if (a.isMEM() && static_cast<const Address&>(a).isBroadcast())
      vbroadcastss(to, ptr[static_cast<const Address&>(a).getRegExp()]);
    else
      vmovups(to, a);
  });
}

void StageAssembler::emit_compound(const MicroOp& op, RegisterAssignment& y) {
  switch (op.op) {
    case Opcode::kSelect:
      return emit_select(op, y);
    case Opcode::kMac: {
      const Vector a = vector_operand(op.operands[0]);
      const Vector to = allocate_result(y);
      with_operand(op.operands[1], [&](const Operand& b) { vmulps(to, a, b); });
      with_operand(op.operands[2], [&](const Operand& c) { vaddps(to, to, c); });
      return;
    }
    case Opcode::kClamp: {
      const Vector high = vector_operand(op.operands[2]), low = vector_operand(op.operands[1]);
      const Vector to = allocate_result(y);
      with_operand(op.operands[0], [&](const Operand& a) { vminps(to, high, a); });
      vmaxps(to, low, to);
      return;
    }
    case Opcode::kMod: {
      const Vector a = vector_operand(op.operands[0]), b = vector_operand(op.operands[1]);
      const Vector to = allocate_result(y);
      vdivps(to, a, b);
      emit_round(to, to, kRoundDown);
      vmulps(to, b, to);
      vsubps(to, a, to);
      return;
    }
    default:
      return emit_unary(op, y);
  }
}

// Only the true branch may be a memory operand.
void StageAssembler::emit_select(const MicroOp& op, RegisterAssignment& y) {
  const int mask = mask_operand(op.operands[0]);
  const Vector no = vector_operand(op.operands[2]);
  const Vector to = allocate_result(y);
  with_operand(op.operands[1], [&](const Operand& yes) {
    if (has_masks_ && is_integer_ && cell_bytes_ == 1)
      vpblendmb(to | Opmask(mask), no, yes);
    else if (has_masks_ && is_integer_ && cell_bytes_ == 2)
      vpblendmw(to | Opmask(mask), no, yes);
    else if (has_masks_)
      vblendmps(to | Opmask(mask), no, yes);
    else if (is_integer_)
      vpblendvb(to, no, yes, vector(mask));
    else
      vblendvps(to, no, yes, vector(mask));
  });
}

void StageAssembler::emit_unary(const MicroOp& op, RegisterAssignment& y) {
  const Vector a = vector_operand(op.operands[0]);
  const Vector to = allocate_result(y);
  switch (op.op) {
    case Opcode::kAbs:
      return with_constant(kMagnitudeMask, [&](const Operand& magnitude) { vandps(to, a, magnitude); });
    case Opcode::kNeg:
      return with_constant(kSignMask, [&](const Operand& sign) { vxorps(to, a, sign); });
    case Opcode::kSqrt:
      return vsqrtps(to, a);
    case Opcode::kFloor:
      return emit_round(to, a, kRoundDown);
    case Opcode::kCeil:
      return emit_round(to, a, kRoundUp);
    case Opcode::kSign:
      return emit_sign(to, a);
    default:
      throw CannotCompile{};
  }
}

void StageAssembler::emit_sign(const Vector& to, const Vector& a) {
  const Vector below = allocate_temporary();
  const int mask = allocate_mask();
  (has_masks_ ? temporary_masks_ : temporaries_).push_back(mask);
  for (const auto& [result, predicate] : {std::pair{to, kGreater}, std::pair{below, kLess}}) {
    with_constant(kZeroBits, [&](const Operand& zero) { emit_mask_compare(mask, a, zero, predicate); });
    emit_mask_as_number(result, mask);
  }
  vsubps(to, to, below);
}

}  // namespace apron::vm

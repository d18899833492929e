// Instruction selection of StageAssembler. Results are bit-identical to those of the kernels.
#include <utility>

#include "apron/vm/jit/StageAssembler.h"

namespace apron::vm {

using program::Opcode;
using Xbyak::Operand;

namespace {

// Immediates of vrndscaleps: round to an integer, suppress exceptions.
constexpr std::uint8_t kRoundDown = 9, kRoundUp = 10;

}  // namespace

void StageAssembler::emit_operation(std::size_t index) {
  const MicroOp& op = stage_.ops[index];
  emit_opcode(op, temps_[index]);
  for (const MicroOperand& arg : op.operands) release_use(arg);
  release_temporaries();
}

void StageAssembler::emit_opcode(const MicroOp& op, RegisterAssignment& y) {
  switch (op.op) {
    case Opcode::kCopy:
      return emit_copy(op, y);
    case Opcode::kAdd:
      return emit_binary(op, y, [&](const Zmm& to, const Zmm& a, const Operand& b) { vaddps(to, a, b); });
    case Opcode::kSub:
      return emit_binary(op, y, [&](const Zmm& to, const Zmm& a, const Operand& b) { vsubps(to, a, b); });
    case Opcode::kMul:
      return emit_binary(op, y, [&](const Zmm& to, const Zmm& a, const Operand& b) { vmulps(to, a, b); });
    case Opcode::kDiv:
      return emit_binary(op, y, [&](const Zmm& to, const Zmm& a, const Operand& b) { vdivps(to, a, b); });
    case Opcode::kMin:
      return emit_binary(op, y, [&](const Zmm& to, const Zmm& a, const Operand& b) { vminps(to, a, b); });
    case Opcode::kMax:
      return emit_binary(op, y, [&](const Zmm& to, const Zmm& a, const Operand& b) { vmaxps(to, a, b); });
    default:
      if (op.op >= Opcode::kLt && op.op <= Opcode::kNe) return emit_compare(op, y);
      if (op.op >= Opcode::kAnd && op.op <= Opcode::kNot) return emit_logic(op, y);
      return emit_compound(op, y);
  }
}

template <class Emit>
void StageAssembler::emit_binary(const MicroOp& op, RegisterAssignment& y, const Emit& instruction) {
  MicroOperand first = op.operands[0], second = op.operands[1];
  const bool commutes = op.op == Opcode::kAdd || op.op == Opcode::kMul;
  // Only the second operand may be in memory.
  if (commutes && second.kind != MicroOperand::Kind::kStream && first.kind == MicroOperand::Kind::kStream)
    std::swap(first, second);
  const Zmm a = vector_operand(first);
  const Zmm to = allocate_result(y);
  with_operand(second, [&](const Operand& b) { instruction(to, a, b); });
}

void StageAssembler::emit_compare(const MicroOp& op, RegisterAssignment& y) {
  switch (op.op) {
    case Opcode::kLt:
      return emit_vcmp(op, y, kLess);
    case Opcode::kLe:
      return emit_vcmp(op, y, kLessEqual);
    case Opcode::kGt:
      return emit_vcmp(op, y, kGreater);
    case Opcode::kGe:
      return emit_vcmp(op, y, kGreaterEqual);
    case Opcode::kEq:
      return emit_vcmp(op, y, kEqual);
    default:
      return emit_vcmp(op, y, kNotEqual);
  }
}

void StageAssembler::emit_vcmp(const MicroOp& op, RegisterAssignment& y, Compare predicate) {
  const Zmm a = vector_operand(op.operands[0]);
  y.mask_register = allocate_mask();
  with_operand(op.operands[1], [&](const Operand& b) { vcmpps(Opmask(y.mask_register), a, b, predicate); });
}

template <class Emit>
void StageAssembler::emit_mask_logic(const MicroOp& op, RegisterAssignment& y, bool invert,
                                     const Emit& instruction) {
  const int a = mask_operand(op.operands[0]), b = mask_operand(op.operands[1]);
  y.mask_register = allocate_mask();
  instruction(Opmask(y.mask_register), Opmask(a), Opmask(b));
  if (invert) knotw(Opmask(y.mask_register), Opmask(y.mask_register));
}

void StageAssembler::emit_logic(const MicroOp& op, RegisterAssignment& y) {
  using Mask = const Opmask&;
  const auto both = [&](Mask to, Mask a, Mask b) { kandw(to, a, b); };
  const auto either = [&](Mask to, Mask a, Mask b) { korw(to, a, b); };
  switch (op.op) {
    case Opcode::kAnd:
      return emit_mask_logic(op, y, false, both);
    case Opcode::kOr:
      return emit_mask_logic(op, y, false, either);
    case Opcode::kXor:
      return emit_mask_logic(op, y, false, [&](Mask to, Mask a, Mask b) { kxorw(to, a, b); });
    case Opcode::kNand:
      return emit_mask_logic(op, y, true, both);
    case Opcode::kNor:
      return emit_mask_logic(op, y, true, either);
    default: {
      const int a = mask_operand(op.operands[0]);
      y.mask_register = allocate_mask();
      knotw(Opmask(y.mask_register), Opmask(a));
    }
  }
}

void StageAssembler::emit_copy(const MicroOp& op, RegisterAssignment& y) {
  const Zmm to = allocate_result(y);
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
      const Zmm a = vector_operand(op.operands[0]);
      const Zmm to = allocate_result(y);
      with_operand(op.operands[1], [&](const Operand& b) { vmulps(to, a, b); });
      with_operand(op.operands[2], [&](const Operand& c) { vaddps(to, to, c); });
      return;
    }
    case Opcode::kClamp: {
      const Zmm high = vector_operand(op.operands[2]), low = vector_operand(op.operands[1]);
      const Zmm to = allocate_result(y);
      with_operand(op.operands[0], [&](const Operand& a) { vminps(to, high, a); });
      vmaxps(to, low, to);
      return;
    }
    case Opcode::kMod: {
      const Zmm a = vector_operand(op.operands[0]), b = vector_operand(op.operands[1]);
      const Zmm to = allocate_result(y);
      vdivps(to, a, b);
      vrndscaleps(to, to, kRoundDown);
      vmulps(to, b, to);
      vsubps(to, a, to);
      return;
    }
    default:
      return emit_unary(op, y);
  }
}

// Blends under a mask register; only the true branch may be a memory operand.
void StageAssembler::emit_select(const MicroOp& op, RegisterAssignment& y) {
  const int k = mask_operand(op.operands[0]);
  const Zmm no = vector_operand(op.operands[2]);
  const Zmm to = allocate_result(y);
  with_operand(op.operands[1], [&](const Operand& yes) { vblendmps(to | Opmask(k), no, yes); });
}

void StageAssembler::emit_unary(const MicroOp& op, RegisterAssignment& y) {
  const Zmm a = vector_operand(op.operands[0]);
  const Zmm to = allocate_result(y);
  switch (op.op) {
    case Opcode::kAbs:
      return vpandd(to, a, constant_register(kMagnitudeMask));
    case Opcode::kNeg:
      return vpxord(to, a, constant_register(kSignMask));
    case Opcode::kSqrt:
      return vsqrtps(to, a);
    case Opcode::kFloor:
      return vrndscaleps(to, a, kRoundDown);
    case Opcode::kCeil:
      return vrndscaleps(to, a, kRoundUp);
    case Opcode::kSign:
      return emit_sign(to, a);
    default:
      throw CannotCompile{};
  }
}

void StageAssembler::emit_sign(const Zmm& to, const Zmm& a) {
  const Opmask k(allocate_mask());
  temporary_masks_.push_back(k.getIdx());
  const Zmm below = allocate_temporary();
  vcmpps(k, a, zero_register(), kGreater);
  vmovaps(to | k | T_z, one_register());
  vcmpps(k, a, zero_register(), kLess);
  vmovaps(below | k | T_z, one_register());
  vsubps(to, to, below);
}

}  // namespace apron::vm

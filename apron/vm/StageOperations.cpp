// The assembler's operations: the same bits as the kernels give.
#include <utility>

#include "apron/vm/StageAssembler.h"

namespace apron::vm {

using program::Opcode;
using Xbyak::Operand;

namespace {

// Of vrndscaleps: to whole numbers, without an exception.
constexpr std::uint8_t kDown = 9, kUp = 10;

}  // namespace

void StageAssembler::operation(std::size_t index) {
  const MicroOp& op = stage_.ops[index];
  emit(op, temps_[index]);
  for (const MicroArg& arg : op.args) used(arg);
  release();
}

void StageAssembler::emit(const MicroOp& op, Value& y) {
  switch (op.op) {
    case Opcode::kCopy:
      return emit_copy(op, y);
    case Opcode::kAdd:
      return binary(op, y, [&](const Zmm& to, const Zmm& a, const Operand& b) { vaddps(to, a, b); });
    case Opcode::kSub:
      return binary(op, y, [&](const Zmm& to, const Zmm& a, const Operand& b) { vsubps(to, a, b); });
    case Opcode::kMul:
      return binary(op, y, [&](const Zmm& to, const Zmm& a, const Operand& b) { vmulps(to, a, b); });
    case Opcode::kDiv:
      return binary(op, y, [&](const Zmm& to, const Zmm& a, const Operand& b) { vdivps(to, a, b); });
    case Opcode::kMin:
      return binary(op, y, [&](const Zmm& to, const Zmm& a, const Operand& b) { vminps(to, a, b); });
    case Opcode::kMax:
      return binary(op, y, [&](const Zmm& to, const Zmm& a, const Operand& b) { vmaxps(to, a, b); });
    default:
      if (op.op >= Opcode::kLt && op.op <= Opcode::kNe) return emit_compare(op, y);
      if (op.op >= Opcode::kAnd && op.op <= Opcode::kNot) return emit_logic(op, y);
      return emit_more(op, y);
  }
}

template <class Emit>
void StageAssembler::binary(const MicroOp& op, Value& y, const Emit& instruction) {
  MicroArg first = op.args[0], second = op.args[1];
  const bool commutes = op.op == Opcode::kAdd || op.op == Opcode::kMul;
  // The second operand may lie in memory.
  if (commutes && second.kind != MicroArg::Kind::kStream && first.kind == MicroArg::Kind::kStream)
    std::swap(first, second);
  const Zmm a = vector(first);
  const Zmm to = result(y);
  with_operand(second, [&](const Operand& b) { instruction(to, a, b); });
}

void StageAssembler::emit_compare(const MicroOp& op, Value& y) {
  switch (op.op) {
    case Opcode::kLt:
      return compare(op, y, kLess);
    case Opcode::kLe:
      return compare(op, y, kLessEqual);
    case Opcode::kGt:
      return compare(op, y, kGreater);
    case Opcode::kGe:
      return compare(op, y, kGreaterEqual);
    case Opcode::kEq:
      return compare(op, y, kEqual);
    default:
      return compare(op, y, kNotEqual);
  }
}

void StageAssembler::compare(const MicroOp& op, Value& y, Compare predicate) {
  const Zmm a = vector(op.args[0]);
  y.mask = new_mask();
  with_operand(op.args[1], [&](const Operand& b) { vcmpps(Opmask(y.mask), a, b, predicate); });
}

template <class Emit>
void StageAssembler::logic(const MicroOp& op, Value& y, bool invert, const Emit& instruction) {
  const int a = truth(op.args[0]), b = truth(op.args[1]);
  y.mask = new_mask();
  instruction(Opmask(y.mask), Opmask(a), Opmask(b));
  if (invert) knotw(Opmask(y.mask), Opmask(y.mask));
}

void StageAssembler::emit_logic(const MicroOp& op, Value& y) {
  using Mask = const Opmask&;
  const auto both = [&](Mask to, Mask a, Mask b) { kandw(to, a, b); };
  const auto either = [&](Mask to, Mask a, Mask b) { korw(to, a, b); };
  switch (op.op) {
    case Opcode::kAnd:
      return logic(op, y, false, both);
    case Opcode::kOr:
      return logic(op, y, false, either);
    case Opcode::kXor:
      return logic(op, y, false, [&](Mask to, Mask a, Mask b) { kxorw(to, a, b); });
    case Opcode::kNand:
      return logic(op, y, true, both);
    case Opcode::kNor:
      return logic(op, y, true, either);
    default: {
      const int a = truth(op.args[0]);
      y.mask = new_mask();
      knotw(Opmask(y.mask), Opmask(a));
    }
  }
}

void StageAssembler::emit_copy(const MicroOp& op, Value& y) {
  const Zmm to = result(y);
  with_operand(op.args[0], [&](const Operand& a) {
    if (a.isMEM() && static_cast<const Address&>(a).isBroadcast())
      vbroadcastss(to, ptr[static_cast<const Address&>(a).getRegExp()]);
    else
      vmovups(to, a);
  });
}

void StageAssembler::emit_more(const MicroOp& op, Value& y) {
  switch (op.op) {
    case Opcode::kSelect:
      return emit_select(op, y);
    case Opcode::kMac: {
      const Zmm a = vector(op.args[0]);
      const Zmm to = result(y);
      with_operand(op.args[1], [&](const Operand& b) { vmulps(to, a, b); });
      with_operand(op.args[2], [&](const Operand& c) { vaddps(to, to, c); });
      return;
    }
    case Opcode::kClamp: {
      const Zmm high = vector(op.args[2]), low = vector(op.args[1]);
      const Zmm to = result(y);
      with_operand(op.args[0], [&](const Operand& a) { vminps(to, high, a); });
      vmaxps(to, low, to);
      return;
    }
    case Opcode::kMod: {
      const Zmm a = vector(op.args[0]), b = vector(op.args[1]);
      const Zmm to = result(y);
      vdivps(to, a, b);
      vrndscaleps(to, to, kDown);
      vmulps(to, b, to);
      vsubps(to, a, to);
      return;
    }
    default:
      return emit_unary(op, y);
  }
}

// The mask's value with memory as the second source; a scalar mask is a vector like any other.
void StageAssembler::emit_select(const MicroOp& op, Value& y) {
  const int k = truth(op.args[0]);
  const Zmm no = vector(op.args[2]);
  const Zmm to = result(y);
  with_operand(op.args[1], [&](const Operand& yes) { vblendmps(to | Opmask(k), no, yes); });
}

void StageAssembler::emit_unary(const MicroOp& op, Value& y) {
  const Zmm a = vector(op.args[0]);
  const Zmm to = result(y);
  switch (op.op) {
    case Opcode::kAbs:
      return vpandd(to, a, constant(kMagnitude));
    case Opcode::kNeg:
      return vpxord(to, a, constant(kSignBit));
    case Opcode::kSqrt:
      return vsqrtps(to, a);
    case Opcode::kFloor:
      return vrndscaleps(to, a, kDown);
    case Opcode::kCeil:
      return vrndscaleps(to, a, kUp);
    case Opcode::kSign:
      return emit_sign(to, a);
    default:
      throw DoesNotFit{};
  }
}

void StageAssembler::emit_sign(const Zmm& to, const Zmm& a) {
  const Opmask k(new_mask());
  loose_masks_.push_back(k.getIdx());
  const Zmm below = loose();
  vcmpps(k, a, zero(), kGreater);
  vmovaps(to | k | T_z, one());
  vcmpps(k, a, zero(), kLess);
  vmovaps(below | k | T_z, one());
  vsubps(to, to, below);
}

}  // namespace apron::vm

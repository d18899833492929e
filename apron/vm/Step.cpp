#include "apron/vm/Step.h"

#include <algorithm>
#include <cassert>

namespace apron::vm {
namespace {

using program::Opcode;
using program::OperandKind;

Action action_of(Opcode op, const KernelTable& kernels) {
  if (kernels.kernel(op, 0, false) != nullptr) return Action::kElementwise;
  switch (op) {
    case Opcode::kShift:
    case Opcode::kRotate:
      return Action::kShift;
    case Opcode::kMaskOn:
    case Opcode::kMaskOff:
    case Opcode::kMaskPush:
    case Opcode::kMaskElse:
    case Opcode::kMaskPop:
      return Action::kMask;
    case Opcode::kGlobalSum:
    case Opcode::kGlobalMean:
    case Opcode::kGlobalMin:
    case Opcode::kGlobalMax:
    case Opcode::kGlobalCount:
    case Opcode::kGlobalAny:
      return Action::kReduce;
    case Opcode::kPixelGet:
    case Opcode::kPixelSet:
    case Opcode::kCellX:
    case Opcode::kCellY:
      return Action::kCell;
    case Opcode::kNearSum:
    case Opcode::kNearMin:
    case Opcode::kNearMax:
    case Opcode::kNearAny:
    case Opcode::kNearAll:
    case Opcode::kFilterDo:
    case Opcode::kFilterSet:
    case Opcode::kFlood:
    case Opcode::kDistance:
    case Opcode::kSpreadMax:
    case Opcode::kRandomFloat:
    case Opcode::kRandomGauss:
    case Opcode::kRandomInt:
    case Opcode::kRandomSeed:
    case Opcode::kStackPush:
    case Opcode::kStackPop:
    case Opcode::kStackClear:
    case Opcode::kResGetVar:
    case Opcode::kResSetVar:
    case Opcode::kResGetReg:
    case Opcode::kResSetReg:
      return Action::kArray;
    default:
      break;
  }
  return program::info(op).locality == program::Locality::Host ? Action::kHost : Action::kFlow;
}

std::int64_t whole(float offset) {
  constexpr float kFar = 1e9F;  // beyond any array, and safe to compute with
  return offset >= -kFar && offset <= kFar ? static_cast<std::int64_t>(offset)
                                           : static_cast<std::int64_t>(kFar);
}

struct Decoder {
  const program::Program& program;
  Storage& storage;
  Step step{};
  unsigned scalar_bits = 0;

  void source(std::size_t k, program::Operand operand) {
    switch (operand.kind) {
      case OperandKind::kRegister:
        step.planes[k] = &storage.registers[operand.index];
        break;
      case OperandKind::kVariable:
        step.scalars[k] = &storage.scalars[operand.index];
        scalar_bits |= 1U << k;
        break;
      case OperandKind::kLiteral:
        step.scalars[k] = &storage.scalars[program.variables.size() + operand.index];
        scalar_bits |= 1U << k;
        break;
      case OperandKind::kText:
        step.text = program.texts[operand.index];
        break;
      case OperandKind::kLabel:
        step.target = operand.index;
        break;
      case OperandKind::kFilter:
      case OperandKind::kGroup:
      case OperandKind::kModule:
        step.table = operand.index;
        break;
      case OperandKind::kNone:
        break;
    }
  }

  void destination(program::Operand operand) {
    if (operand.kind == OperandKind::kRegister) step.y = &storage.registers[operand.index];
    if (operand.kind == OperandKind::kVariable) step.variable = &storage.scalars[operand.index];
  }
};

}  // namespace

bool is_conditional_jump(Opcode op) noexcept { return op >= Opcode::kJumpLt && op <= Opcode::kUnlessGe; }

bool jumps(Opcode op, float a, float b) noexcept {
  switch (op) {
    case Opcode::kJumpLt:
      return a < b;
    case Opcode::kJumpLe:
      return a <= b;
    case Opcode::kJumpGt:
      return a > b;
    case Opcode::kJumpGe:
      return a >= b;
    case Opcode::kJumpEq:
      return a == b;
    case Opcode::kJumpNe:
      return a != b;
    case Opcode::kUnlessLt:
      return !(a < b);
    case Opcode::kUnlessLe:
      return !(a <= b);
    case Opcode::kUnlessGt:
      return !(a > b);
    default:
      return !(a >= b);
  }
}

Step decode(const program::Program& program, const program::Instruction& instruction, Storage& storage,
            const KernelTable& kernels) {
  Decoder d{program, storage};
  Step& step = d.step;
  step.op = instruction.op;
  step.masked = instruction.masked;
  step.action = action_of(step.op, kernels);
  d.destination(instruction.destination);
  for (std::size_t k = 0; k < instruction.operands.size(); ++k) d.source(k, instruction.operands[k]);
  if (step.action == Action::kElementwise) {
    if (step.variable != nullptr) step.action = Action::kScalar;
    step.kernels = {kernels.kernel(step.op, d.scalar_bits, false),
                    kernels.kernel(step.op, d.scalar_bits, true)};
    assert(step.kernels[0] != nullptr);
  }
  if (step.action == Action::kShift) step.offset = {whole(*step.scalars[1]), whole(*step.scalars[2])};
  if (step.op == Opcode::kBoundary) step.edge.rule = static_cast<program::BoundaryRule>(*step.scalars[0]);
  if (step.op == Opcode::kParameter) {
    const auto named = [&](const program::Parameter& p) { return p.name == step.text; };
    const auto found = std::find_if(program.parameters.begin(), program.parameters.end(), named);
    if (found != program.parameters.end()) step.initial = found->initial;
  }
  return step;
}

}  // namespace apron::vm

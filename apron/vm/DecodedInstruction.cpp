#include "apron/vm/DecodedInstruction.h"

#include <algorithm>
#include <cassert>

namespace apron::vm {
namespace {

using program::Opcode;
using program::OperandKind;

DispatchKind dispatch_kind_of(Opcode op, const KernelTable& kernels) {
  if (kernels.kernel(op, 0, false) != nullptr) return DispatchKind::kElementwise;
  switch (op) {
    case Opcode::kShift:
    case Opcode::kRotate:
      return DispatchKind::kShift;
    case Opcode::kMaskOn:
    case Opcode::kMaskOff:
    case Opcode::kMaskPush:
    case Opcode::kMaskElse:
    case Opcode::kMaskPop:
      return DispatchKind::kMask;
    case Opcode::kGlobalSum:
    case Opcode::kGlobalMean:
    case Opcode::kGlobalMin:
    case Opcode::kGlobalMax:
    case Opcode::kGlobalCount:
    case Opcode::kGlobalAny:
      return DispatchKind::kReduce;
    case Opcode::kPixelGet:
    case Opcode::kPixelSet:
    case Opcode::kCellX:
    case Opcode::kCellY:
      return DispatchKind::kCellAccess;
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
      return DispatchKind::kArrayOp;
    default:
      break;
  }
  return program::opcode_info(op).locality == program::Locality::Host ? DispatchKind::kHost
                                                                      : DispatchKind::kControlFlow;
}

struct Decoder {
  const program::Program& program;
  RegisterFile& register_file;
  DecodedInstruction decoded{};
  unsigned scalar_bits = 0;

  void decode_source(std::size_t k, program::Operand operand) {
    switch (operand.kind) {
      case OperandKind::kRegister:
        decoded.planes[k] = &register_file.registers[operand.index];
        break;
      case OperandKind::kVariable:
        decoded.scalars[k] = &register_file.scalars[operand.index];
        scalar_bits |= 1U << k;
        break;
      case OperandKind::kLiteral:
        decoded.scalars[k] = &register_file.scalars[program.variables.size() + operand.index];
        scalar_bits |= 1U << k;
        break;
      case OperandKind::kText:
        decoded.text = program.texts[operand.index];
        break;
      case OperandKind::kLabel:
        decoded.jump_target = operand.index;
        break;
      case OperandKind::kFilter:
      case OperandKind::kGroup:
      case OperandKind::kModule:
        decoded.table_index = operand.index;
        break;
      case OperandKind::kNone:
        break;
    }
  }

  void decode_destination(program::Operand operand) {
    if (operand.kind == OperandKind::kRegister) decoded.destination = &register_file.registers[operand.index];
    if (operand.kind == OperandKind::kVariable)
      decoded.destination_variable = &register_file.scalars[operand.index];
  }
};

}  // namespace

std::int64_t to_offset(double offset) noexcept {
  constexpr double kFar = 1e9;  // larger than any array, and does not overflow in index arithmetic
  return offset >= -kFar && offset <= kFar ? static_cast<std::int64_t>(offset)
                                           : static_cast<std::int64_t>(kFar);
}

bool is_conditional_jump(Opcode op) noexcept { return op >= Opcode::kJumpLt && op <= Opcode::kUnlessGe; }

bool is_branch_taken(Opcode op, double a, double b) noexcept {
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

DecodedInstruction decode(const program::Program& program, const program::Instruction& instruction,
                          RegisterFile& register_file, const KernelTable& kernels) {
  Decoder d{program, register_file};
  DecodedInstruction& decoded = d.decoded;
  decoded.op = instruction.op;
  decoded.masked = instruction.masked;
  decoded.dispatch = dispatch_kind_of(decoded.op, kernels);
  d.decode_destination(instruction.destination);
  for (std::size_t k = 0; k < instruction.operands.size(); ++k) d.decode_source(k, instruction.operands[k]);
  if (decoded.dispatch == DispatchKind::kElementwise) {
    if (decoded.destination_variable != nullptr) decoded.dispatch = DispatchKind::kScalar;
    decoded.kernels = {kernels.kernel(decoded.op, d.scalar_bits, false),
                       kernels.kernel(decoded.op, d.scalar_bits, true)};
    assert(decoded.kernels[0] != nullptr);
  }
  if (decoded.dispatch == DispatchKind::kShift) {
    decoded.has_variable_offset = instruction.operands[1].kind == OperandKind::kVariable ||
                                  instruction.operands[2].kind == OperandKind::kVariable;
    if (!decoded.has_variable_offset)
      decoded.offset = {to_offset(*decoded.scalars[1]), to_offset(*decoded.scalars[2])};
  }
  if (decoded.op == Opcode::kBoundary)
    decoded.boundary.rule = static_cast<program::BoundaryRule>(*decoded.scalars[0]);
  if (decoded.op == Opcode::kParameter) {
    const auto named = [&](const program::Parameter& p) { return p.name == decoded.text; };
    const auto found = std::find_if(program.parameters.begin(), program.parameters.end(), named);
    if (found != program.parameters.end()) decoded.default_value = found->default_value;
  }
  return decoded;
}

}  // namespace apron::vm

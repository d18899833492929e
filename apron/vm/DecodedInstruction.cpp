#include "apron/vm/DecodedInstruction.h"

#include <algorithm>
#include <cassert>

#include "apron/program/ScalarArithmetic.h"

namespace apron::vm {
namespace {

using program::Opcode;
using program::OperandKind;

DispatchKind dispatch_kind_of(Opcode op, const KernelTable& kernels) {
  if (kernels.kernel(op, 0, false) != nullptr || program::takes_only_integers(op))
    return DispatchKind::kElementwise;
  if (op == Opcode::kConvert || op == Opcode::kConvertSaturated) return DispatchKind::kConvert;
  // opcodes.def lists the instructions of a kind one after the other.
  const auto is_between = [op](Opcode first, Opcode last) { return op >= first && op <= last; };
  if (op == Opcode::kShift || op == Opcode::kRotate) return DispatchKind::kShift;
  if (is_between(Opcode::kMaskOn, Opcode::kMaskPop)) return DispatchKind::kMask;
  if (is_between(Opcode::kGlobalSum, Opcode::kGlobalAny)) return DispatchKind::kReduce;
  if (is_between(Opcode::kPixelGet, Opcode::kCellY)) return DispatchKind::kCellAccess;
  if (is_between(Opcode::kNearSum, Opcode::kMatrixProduct) ||
      is_between(Opcode::kRandomFloat, Opcode::kResSetReg))
    return DispatchKind::kArrayOp;
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
      case OperandKind::kGroup:
        decoded.groups[k] = operand.index;
        break;
      case OperandKind::kFilter:
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

bool is_conditional_jump(Opcode op) noexcept { return op >= Opcode::kJumpLt && op <= Opcode::kUnlessGe; }

bool is_branch_taken(Opcode op, double a, double b) noexcept {
  // jump.lt to jump.ne and unless.lt to unless.ge have the order of lt to ne.
  const bool is_unless = op >= Opcode::kUnlessLt;
  const int index = static_cast<int>(op) - static_cast<int>(is_unless ? Opcode::kUnlessLt : Opcode::kJumpLt);
  const auto comparison = static_cast<Opcode>(static_cast<int>(Opcode::kLt) + index);
  return (program::evaluate_scalar(comparison, a, b, 0.0) != 0.0) != is_unless;
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
  const Plane* first = decoded.destination;
  for (const Plane* plane : decoded.planes)
    if (first == nullptr) first = plane;
  if (first != nullptr) decoded.type = first->type;
  if (decoded.dispatch == DispatchKind::kElementwise) {
    if (decoded.destination_variable != nullptr) decoded.dispatch = DispatchKind::kScalar;
    decoded.kernels = {kernels.kernel(decoded.op, d.scalar_bits, false, decoded.type),
                       kernels.kernel(decoded.op, d.scalar_bits, true, decoded.type)};
    assert(decoded.kernels[0] != nullptr || decoded.dispatch == DispatchKind::kScalar);
  }
  if (decoded.dispatch == DispatchKind::kConvert) {
    const bool saturated = decoded.op == Opcode::kConvertSaturated;
    decoded.kernels = {kernels.conversion(decoded.planes[0]->type, decoded.type, saturated, false),
                       kernels.conversion(decoded.planes[0]->type, decoded.type, saturated, true)};
  }
  if (decoded.dispatch == DispatchKind::kShift) {
    decoded.has_variable_offset = instruction.operands[1].kind == OperandKind::kVariable ||
                                  instruction.operands[2].kind == OperandKind::kVariable;
    if (!decoded.has_variable_offset)
      decoded.offset = {static_cast<std::int64_t>(*decoded.scalars[1]),
                        static_cast<std::int64_t>(*decoded.scalars[2])};
  }
  if (decoded.op == Opcode::kBoundary)
    decoded.boundary.rule = static_cast<program::BoundaryRule>(*decoded.scalars[0]);
  if (decoded.op == Opcode::kParameter) {
    const auto found = std::ranges::find(program.parameters, decoded.text, &program::Parameter::name);
    if (found != program.parameters.end()) decoded.default_value = found->default_value;
  }
  return decoded;
}

}  // namespace apron::vm

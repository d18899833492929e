#include "apron/program/LocalProfile.h"

#include <fmt/format.h>

#include <cmath>

namespace apron::program {
namespace {

// The literal behind an operand, 0 for a variable (verify() refuses those where it matters).
float literal(const Program& program, const Operand& operand) noexcept {
  const bool known = operand.kind == OperandKind::kLiteral && operand.index < program.literals.size();
  return known ? program.literals[operand.index] : 0.0F;
}

std::string reason(const Program& program, const Instruction& instruction) {
  const std::string_view mnemonic = info(instruction.op).mnemonic;
  if (instruction.op == Opcode::kShift || instruction.op == Opcode::kRotate) {
    const float dx = literal(program, instruction.operands[1]);
    const float dy = literal(program, instruction.operands[2]);
    if (instruction.op == Opcode::kRotate) {
      return fmt::format("rotate by ({}, {}) joins opposite edges of the array", dx, dy);
    }
    return fmt::format("shift by ({}, {}) reaches beyond the north, east, south and west neighbours", dx, dy);
  }
  if (instruction.op == Opcode::kFilterDo) {
    const Filter& filter = program.filters[instruction.operands[1].index];
    return fmt::format("a filter of {}x{} reaches beyond the neighbours", filter.width, filter.height);
  }
  if (info(instruction.op).locality == Locality::Far) {
    return fmt::format("{} propagates through the array until nothing changes", mnemonic);
  }
  return fmt::format("{} needs the whole array", mnemonic);
}

}  // namespace

// A filter of 3x3 is a sum of steps to direct neighbours, as near.sum of 8 is.
Locality locality(const Program& program, const Instruction& instruction) noexcept {
  if (instruction.op == Opcode::kFilterDo) {
    const Filter& filter = program.filters[instruction.operands[1].index];
    return filter.width <= 3 && filter.height <= 3 ? Locality::News : Locality::Far;
  }
  if (instruction.op != Opcode::kShift) return info(instruction.op).locality;
  const float steps = std::fabs(literal(program, instruction.operands[1])) +
                      std::fabs(literal(program, instruction.operands[2]));
  return steps <= 1.0F ? Locality::News : Locality::Far;
}

std::vector<NonLocal> beyond_local(const Program& program) {
  std::vector<NonLocal> found;
  for (std::size_t i = 0; i < program.code.size(); ++i) {
    const Locality need = locality(program, program.code[i]);
    if (need == Locality::Far || need == Locality::Global)
      found.push_back({i, reason(program, program.code[i])});
  }
  return found;
}

}  // namespace apron::program

#include "apron/program/LocalityCheck.h"

#include <fmt/format.h>

#include <cmath>

namespace apron::program {
namespace {

// The value of a literal operand; 0 for a variable.
double literal_or_zero(const Program& program, const Operand& operand) noexcept {
  const bool known = operand.kind == OperandKind::kLiteral && operand.index < program.literals.size();
  return known ? program.literals[operand.index] : 0.0;
}

bool has_variable_offset(const Instruction& instruction) noexcept {
  return instruction.operands[1].kind == OperandKind::kVariable ||
         instruction.operands[2].kind == OperandKind::kVariable;
}

std::string nonlocality_reason(const Program& program, const Instruction& instruction) {
  const std::string_view mnemonic = opcode_info(instruction.op).mnemonic;
  if (instruction.op == Opcode::kShift || instruction.op == Opcode::kRotate) {
    const double dx = literal_or_zero(program, instruction.operands[1]);
    const double dy = literal_or_zero(program, instruction.operands[2]);
    if (has_variable_offset(instruction))
      return fmt::format("{} by a distance that is computed at run time may reach any cell", mnemonic);
    if (instruction.op == Opcode::kRotate) {
      return fmt::format("rotate by ({}, {}) joins opposite edges of the array", dx, dy);
    }
    return fmt::format("shift by ({}, {}) reaches beyond the north, east, south and west neighbours", dx, dy);
  }
  if (instruction.op == Opcode::kFilterDo) {
    const Filter& filter = program.filters[instruction.operands[1].index];
    return fmt::format("a filter of {}x{} reaches beyond the neighbours", filter.width, filter.height);
  }
  if (opcode_info(instruction.op).locality == Locality::Far) {
    return fmt::format("{} propagates through the array until nothing changes", mnemonic);
  }
  return fmt::format("{} needs the whole array", mnemonic);
}

}  // namespace

// A filter of at most 3x3 decomposes into steps to direct neighbours, as near.sum of 8 does.
Locality locality(const Program& program, const Instruction& instruction) noexcept {
  if (instruction.op == Opcode::kFilterDo) {
    const Filter& filter = program.filters[instruction.operands[1].index];
    return filter.width <= 3 && filter.height <= 3 ? Locality::News : Locality::Far;
  }
  if (instruction.op != Opcode::kShift) return opcode_info(instruction.op).locality;
  if (has_variable_offset(instruction)) return Locality::Far;
  const double distance = std::fabs(literal_or_zero(program, instruction.operands[1])) +
                          std::fabs(literal_or_zero(program, instruction.operands[2]));
  return distance <= 1.0 ? Locality::News : Locality::Far;
}

std::vector<NonLocalInstruction> find_nonlocal_instructions(const Program& program) {
  std::vector<NonLocalInstruction> nonlocal;
  for (std::size_t i = 0; i < program.code.size(); ++i) {
    const Locality required = locality(program, program.code[i]);
    if (required == Locality::Far || required == Locality::Global)
      nonlocal.push_back({i, nonlocality_reason(program, program.code[i])});
  }
  return nonlocal;
}

}  // namespace apron::program

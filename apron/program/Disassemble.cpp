#include <fmt/format.h>

#include "apron/program/Program.h"

namespace apron::program {
namespace {

// The shortest text of the 32-bit float, or all digits of a whole number that is none.
std::string literal_text(double value) {
  const auto cell = static_cast<float>(value);
  return static_cast<double>(cell) == value || value != value ? fmt::format("{}", cell)
                                                              : fmt::format("{}", value);
}

std::string operand_text(const Program& program, const Operand& operand) {
  switch (operand.kind) {
    case OperandKind::kNone:
      return "-";
    case OperandKind::kRegister:
      return program.registers.at(operand.index).name;
    case OperandKind::kVariable:
      return program.variables.at(operand.index).name;
    case OperandKind::kLiteral:
      return literal_text(program.literals.at(operand.index));
    case OperandKind::kText:
      return fmt::format("'{}'", program.texts.at(operand.index));
    case OperandKind::kLabel:
      return fmt::format("@{}", operand.index);
    case OperandKind::kFilter:
      return fmt::format("filter '{}'", program.filters.at(operand.index).name);
    case OperandKind::kGroup:
      return program.groups.at(operand.index).name;
    case OperandKind::kModule:
      return fmt::format("module '{}'", program.modules.at(operand.index));
  }
  return "?";
}

std::string operand_list(const Program& program, const Instruction& instruction) {
  std::string list;
  const auto append = [&](const Operand& operand) {
    if (operand.kind == OperandKind::kNone) return;
    if (!list.empty()) list += ", ";
    list += operand_text(program, operand);
  };
  append(instruction.destination);
  for (const Operand& operand : instruction.operands) append(operand);
  return list;
}

}  // namespace

std::string disassemble(const Program& program, std::size_t index) {
  const Instruction& instruction = program.code.at(index);
  std::string line = fmt::format("{:>5}  {:<15} {}", index, opcode_info(instruction.op).mnemonic,
                                 operand_list(program, instruction));
  if (const SourceLocation* source = find_location(program, index); source != nullptr && source->line > 0)
    line = fmt::format("{:<55} ; {}:{}", line, program.files.at(source->file), source->line);
  while (!line.empty() && line.back() == ' ') line.pop_back();
  return line;
}

std::string disassemble(const Program& program) {
  std::string text;
  for (std::size_t i = 0; i < program.code.size(); ++i) text += disassemble(program, i) + '\n';
  return text;
}

}  // namespace apron::program

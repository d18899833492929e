#include <fmt/format.h>

#include "apron/program/Program.h"

namespace apron::program {
namespace {

// The shortest text of the 32-bit float, or all digits of a whole number that no 32-bit float equals.
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
      return fmt::format("module '{}'", program.modules.at(operand.index).name);
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

// Appends the cells' type if they are integers: that of the destination, or else of the first register.
std::string mnemonic(const Program& program, const Instruction& instruction) {
  std::string text(opcode_info(instruction.op).mnemonic);
  const Operand* reg = &instruction.destination;
  for (const Operand& operand : instruction.operands)
    if (reg->kind != OperandKind::kRegister) reg = &operand;
  if (reg->kind != OperandKind::kRegister) return text;
  const CellType type = program.registers.at(reg->index).type;
  if (is_integer(type) || instruction.op == Opcode::kConvert || instruction.op == Opcode::kConvertSaturated)
    text.append(".").append(cell_type_name(type));
  return text;
}

}  // namespace

std::string disassemble(const Program& program, std::size_t index) {
  const Instruction& instruction = program.code.at(index);
  std::string line = fmt::format("{:>5}  {:<15} {}", index, mnemonic(program, instruction),
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

std::string instruction_table() {
  static constexpr std::string_view kReach[] = {"Cell", "News", "Far", "Global", "Control", "Host"};
  std::string text =
      "Operands, the destination first: R register, V scalar, D, I or E either (D and I: cell by cell,\n"
      "I: integers), - none; sources: r register, a register of any type, s scalar or number, x register,\n"
      "scalar or number, t text, l label, k filter, g class, m module. Reach: Cell its own cell, News its\n"
      "neighbours, Far beyond them, Global the whole array, Control the array's controller, Host the\n"
      "computer beside it.\n\n";
  for (std::size_t i = 0; i < opcode_count(); ++i) {
    const OpcodeInfo& one = opcode_info(static_cast<Opcode>(i));
    text += fmt::format("{:<20} {:<6} {:<8} {}\n", one.mnemonic, one.signature,
                        kReach[static_cast<std::size_t>(one.locality)], one.description);
  }
  return text;
}

}  // namespace apron::program

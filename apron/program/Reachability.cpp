#include "apron/program/Reachability.h"

#include <algorithm>

namespace apron::program {

bool can_reach(const Program& program, Opcode wanted) {
  std::vector<bool> seen(program.code.size(), false);
  std::vector<std::size_t> work{0};
  while (!work.empty()) {
    const std::size_t index = work.back();
    work.pop_back();
    if (index >= seen.size() || seen[index]) continue;
    seen[index] = true;
    const Instruction& instruction = program.code[index];
    if (instruction.op == wanted) return true;
    for (const Operand& operand : instruction.operands)
      if (operand.kind == OperandKind::kLabel) work.push_back(operand.index);
    const bool continues =
        instruction.op != Opcode::kJump && instruction.op != Opcode::kReturn && instruction.op != Opcode::kEnd;
    if (continues) work.push_back(index + 1);  // behind a call: its routine is assumed to return
  }
  return false;
}

bool uses_surface(const Program& program) {
  return std::any_of(program.code.begin(), program.code.end(), [](const Instruction& instruction) {
    return instruction.op == Opcode::kSurfaceSense || instruction.op == Opcode::kSurfaceActuate;
  });
}

}  // namespace apron::program

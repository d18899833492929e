#include "apron/program/Reachability.h"

#include <algorithm>
#include <utility>
#include <vector>

namespace apron::program {

namespace {

std::vector<bool> find_reachable(const Program& program) {
  return walk(program.code.size(), {0}, [&](std::size_t index) { return successors(program, index); });
}

}  // namespace

std::vector<std::size_t> successors(const Program& program, std::size_t index) {
  const Instruction& instruction = program.code[index];
  std::vector<std::size_t> next;
  for (const Operand& operand : instruction.operands)
    if (operand.kind == OperandKind::kLabel) next.push_back(operand.index);
  const bool continues =
      instruction.op != Opcode::kJump && instruction.op != Opcode::kReturn && instruction.op != Opcode::kEnd;
  if (continues && index + 1 < program.code.size()) next.push_back(index + 1);
  return next;
}

bool can_reach(const Program& program, Opcode wanted) {
  const std::vector<bool> reachable = find_reachable(program);
  for (std::size_t index = 0; index < reachable.size(); ++index)
    if (reachable[index] && program.code[index].op == wanted) return true;
  return false;
}

bool uses_surface(const Program& program) {
  return std::ranges::any_of(program.code, [](const Instruction& instruction) {
    return instruction.op == Opcode::kSurfaceSense || instruction.op == Opcode::kSurfaceActuate ||
           instruction.op == Opcode::kSurfaceStep;
  });
}

std::optional<std::size_t> find_loop_without_step(const Program& program) {
  const std::size_t size = program.code.size();
  std::vector<std::vector<std::size_t>> predecessors(size);
  std::vector<std::size_t> goals;
  for (std::size_t index = 0; index < size; ++index) {
    const Opcode op = program.code[index].op;
    if (op == Opcode::kSurfaceStep || op == Opcode::kEnd || op == Opcode::kReturn) goals.push_back(index);
    for (const std::size_t next : successors(program, index)) predecessors[next].push_back(index);
  }
  const std::vector<bool> proceeds =
      walk(size, std::move(goals),
           [&](std::size_t index) -> const std::vector<std::size_t>& { return predecessors[index]; });
  const std::vector<bool> reachable = find_reachable(program);
  for (std::size_t index = 0; index < size; ++index)
    if (reachable[index] && !proceeds[index]) return index;
  return std::nullopt;
}

std::optional<std::size_t> find_endless_loop(const Program& program) {
  const std::vector<bool> reachable = find_reachable(program);
  std::optional<std::size_t> last;
  for (std::size_t index = 0; index < reachable.size(); ++index) {
    if (!reachable[index]) continue;
    const Opcode op = program.code[index].op;
    if (op == Opcode::kSurfaceStep || op == Opcode::kEnd || op == Opcode::kReturn) return std::nullopt;
    if (std::ranges::any_of(successors(program, index), [&](std::size_t next) { return next <= index; }))
      last = index;
  }
  return last;
}

}  // namespace apron::program

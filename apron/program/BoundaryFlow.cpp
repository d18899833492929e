#include "apron/program/BoundaryFlow.h"

#include <algorithm>

#include "apron/program/Reachability.h"

namespace apron::program {
namespace {

// The condition that the instruction `boundary` sets; nullopt if its value is a variable.
std::optional<BoundaryCondition> condition_set(const Program& program, const Instruction& boundary) {
  const auto rule = static_cast<BoundaryRule>(program.literals[boundary.operands[0].index]);
  if (rule != BoundaryRule::kValue) return BoundaryCondition{rule, 0.0};
  if (boundary.operands[1].kind != OperandKind::kLiteral) return std::nullopt;
  const double value = program.literals[boundary.operands[1].index];
  return value == value ? std::optional(BoundaryCondition{rule, value}) : std::nullopt;
}

bool reads_neighbours(Opcode op) {
  return op == Opcode::kShift || op == Opcode::kFilterDo ||
         (op >= Opcode::kNearSum && op <= Opcode::kNearAll);
}

}  // namespace

// Forward data-flow analysis: constant propagation of the boundary condition, which is zero at the start.
std::vector<std::optional<BoundaryCondition>> boundaries_in_force(const Program& program) {
  enum class State : std::uint8_t { kUnvisited, kConstant, kVarying };
  // A return may go to any return site, by way of the node after the last instruction.
  const std::size_t returned = program.code.size();
  std::vector<std::size_t> return_sites, worklist;
  for (std::size_t at = 0; at + 1 < program.code.size(); ++at)
    if (program.code[at].op == Opcode::kCall) return_sites.push_back(at + 1);
  std::vector<State> state(returned + 1, State::kUnvisited);
  std::vector<std::optional<BoundaryCondition>> in_force(returned + 1);
  const auto merge = [&](std::size_t at, const std::optional<BoundaryCondition>& boundary) {
    const auto differs = [&] {
      return !boundary || boundary->rule != in_force[at]->rule || boundary->value != in_force[at]->value;
    };
    if (state[at] == State::kUnvisited) {
      state[at] = boundary ? State::kConstant : State::kVarying;
      in_force[at] = boundary;
    } else if (state[at] == State::kConstant && differs()) {
      state[at] = State::kVarying;
      in_force[at].reset();
    } else {
      return;
    }
    worklist.push_back(at);
  };
  if (!program.code.empty()) merge(0, BoundaryCondition{});
  while (!worklist.empty()) {
    const std::size_t at = worklist.back();
    worklist.pop_back();
    if (at == returned) {
      for (const std::size_t site : return_sites) merge(site, in_force[at]);
      continue;
    }
    const Instruction& instruction = program.code[at];
    const auto after =
        instruction.op == Opcode::kBoundary ? condition_set(program, instruction) : in_force[at];
    if (instruction.op == Opcode::kReturn) merge(returned, after);
    for (const std::size_t next : successors(program, at)) merge(next, after);
  }
  in_force.pop_back();
  return in_force;
}

std::vector<BoundaryMismatch> find_boundary_mismatches(const Program& program) {
  std::vector<BoundaryMismatch> found;
  const auto may_mismatch = [&](const Instruction& instruction) {
    if (instruction.op != Opcode::kBoundary) return false;
    const auto boundary = condition_set(program, instruction);
    return boundary && !is_cell_value(CellType::kUint8, boundary->value);  // the least of the types
  };
  if (std::ranges::none_of(program.code, may_mismatch)) return found;
  const auto in_force = boundaries_in_force(program);
  for (std::size_t at = 0; at < program.code.size(); ++at) {
    const Instruction& instruction = program.code[at];
    if (!reads_neighbours(instruction.op) || !in_force[at] || in_force[at]->rule != BoundaryRule::kValue)
      continue;
    const CellType type = program.registers[instruction.destination.index].type;
    if (!is_cell_value(type, in_force[at]->value)) found.push_back({at, in_force[at]->value, type});
  }
  return found;
}

}  // namespace apron::program

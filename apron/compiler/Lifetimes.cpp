#include "apron/compiler/Lifetimes.h"

#include <algorithm>
#include <iterator>
#include <map>

#include "apron/program/Reachability.h"

namespace apron::compiler {

using program::Instruction;
using program::Opcode;
using program::Operand;
using program::OperandKind;

Lifetimes::Lifetimes(const program::Program& program, const std::vector<Temporary>& temporaries,
                     const std::vector<bool>& keeps_cells)
    : program_(program), temporaries_(temporaries), keeps_cells_(keeps_cells) {
  std::map<std::size_t, Target> targets;
  for (std::size_t at = 0; at < program.code.size(); ++at) {
    const Instruction& instruction = program.code[at];
    if (instruction.op == Opcode::kCall) {
      calls_.push_back(at);
      continue;
    }
    for (const Operand& operand : instruction.operands) {
      if (operand.kind != OperandKind::kLabel) continue;
      jumps_.push_back({at, operand.index});
      targets.try_emplace(operand.index, Target{operand.index, at, at}).first->second.last_source = at;
    }
  }
  for (const auto& [position, target] : targets) targets_.push_back(target);
  recursive_calls_ = find_recursive_calls();
}

// A jump from before its life comes back only if another leaves; otherwise it passes over the first write.
bool Lifetimes::is_left(std::uint32_t number) const {
  const auto& [storage, is_register, first, last, entry] = temporaries_[number];
  const auto call = std::ranges::lower_bound(calls_, first);
  if (call != calls_.end() && *call < last) return true;
  bool is_entered = false;
  for (auto target = std::ranges::upper_bound(targets_, first, {}, &Target::position);
       target != targets_.end() && target->position < last; ++target) {
    const bool is_later = target->last_source >= last;
    if (!is_later && target->first_source >= first) continue;
    if (!is_read(number, target->position, first)) continue;
    if (is_later) return true;
    is_entered = true;
  }
  if (!is_entered) return false;
  auto jump = std::ranges::lower_bound(jumps_, first, {}, &Jump::position);
  while (jump != jumps_.end() && jump->position < last && jump->target >= first && jump->target <= last)
    ++jump;
  return jump != jumps_.end() && jump->position < last;
}

bool Lifetimes::is_read_first(std::uint32_t number) const {
  const std::size_t entry = temporaries_[number].entry;
  return entry != Temporary::kNone && is_read(number, entry + 1, entry);
}

std::optional<std::size_t> Lifetimes::find_recursion(std::uint32_t number) const {
  const auto& [storage, is_register, first, last, entry] = temporaries_[number];
  for (auto call = std::ranges::lower_bound(recursive_calls_, first);
       call != recursive_calls_.end() && *call < last; ++call)
    if (is_read(number, *call + 1, first)) return *call;
  return std::nullopt;
}

// The calls whose routine runs into them again and then returns.
std::vector<std::size_t> Lifetimes::find_recursive_calls() const {
  const std::size_t size = program_.code.size();
  const auto successors = [&](std::size_t at) {
    std::vector<std::size_t> next = program::successors(program_, at);
    if (program_.code[at].op == Opcode::kCall) std::erase(next, callee(at));
    if (program_.code[at].op == Opcode::kCall && next.empty()) next.push_back(at + 1);
    return next;
  };
  std::vector<std::size_t> recursive;
  if (calls_.empty()) return recursive;
  std::vector<std::vector<std::size_t>> predecessors(size);
  std::vector<std::size_t> returns;
  for (std::size_t at = 0; at < size; ++at) {
    if (program_.code[at].op == Opcode::kReturn) returns.push_back(at);
    for (const std::size_t next : successors(at)) predecessors[next].push_back(at);
  }
  const std::vector<bool> can_return = program::walk(
      size, returns, [&](std::size_t at) -> const std::vector<std::size_t>& { return predecessors[at]; });
  std::map<std::size_t, std::vector<std::size_t>> callers;
  for (const std::size_t call : calls_) callers[callee(call)].push_back(call);
  for (const auto& [routine, calls] : callers) {
    const std::vector<bool> reached = program::walk(size, {routine}, [&](std::size_t at) {
      std::vector<std::size_t> next = program::successors(program_, at);
      std::erase_if(next, [&](std::size_t to) { return !can_return[to]; });
      return next;
    });
    std::ranges::copy_if(calls, std::back_inserter(recursive),
                         [&](std::size_t call) { return reached[call] && can_return[call]; });
  }
  std::ranges::sort(recursive);
  return recursive;
}

bool Lifetimes::reads(std::size_t instruction, std::uint32_t number) const {
  const Instruction& in = program_.code[instruction];
  const std::uint32_t index = number | kTemporaryBit;
  const OperandKind kind = temporaries_[number].is_register ? OperandKind::kRegister : OperandKind::kVariable;
  const auto is_it = [&](const Operand& operand) {
    if (operand.kind != OperandKind::kGroup) return operand == Operand{kind, index};
    const program::OperandGroup& group = program_.groups[operand.index];
    return group.is_variable_group != temporaries_[number].is_register &&
           std::ranges::find(group.members, index) != group.members.end();
  };
  return std::ranges::any_of(in.operands, is_it);
}

bool Lifetimes::overwrites(std::size_t instruction, std::uint32_t number) const {
  const Instruction& in = program_.code[instruction];
  const OperandKind kind = temporaries_[number].is_register ? OperandKind::kRegister : OperandKind::kVariable;
  return in.destination == Operand{kind, number | kTemporaryBit} && in.op != Opcode::kPixelSet &&
         !keeps_cells_[instruction];
}

// True if a path from `start` through instructions of its life, the first one being `low`, reads it before it
// overwrites it. The instruction after its life may read it.
bool Lifetimes::is_read(std::uint32_t number, std::size_t start, std::size_t low) const {
  const std::size_t high = std::min(temporaries_[number].last, program_.code.size() - 1);
  std::vector<bool> seen(high + 1 - low, false);
  std::vector<std::size_t> work{start};
  while (!work.empty()) {
    const std::size_t at = work.back();
    work.pop_back();
    if (at < low || at > high || seen[at - low]) continue;
    seen[at - low] = true;
    if (reads(at, number)) return true;
    if (overwrites(at, number)) continue;
    for (const std::size_t next : program::successors(program_, at)) work.push_back(next);
  }
  return false;
}

}  // namespace apron::compiler

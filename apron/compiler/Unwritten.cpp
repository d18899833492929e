#include "apron/compiler/Unwritten.h"

#include <map>
#include <set>

namespace apron::compiler {
namespace {

using program::Opcode;
using program::OperandKind;
using program::Program;

class Reach {
 public:
  explicit Reach(const Program& program) : program_(program) {
    for (std::size_t i = 0; i < program.code.size(); ++i) {
      if (program.code[i].op == Opcode::kCall) returns_to_.push_back(i + 1);
    }
  }

  // Everything that can run after one of these instructions.
  std::vector<bool> after(const std::vector<std::size_t>& writes) const {
    std::vector<bool> seen(program_.code.size(), false);
    std::vector<std::size_t> work;
    for (const std::size_t write : writes) follow(write, seen, work);
    while (!work.empty()) {
      const std::size_t at = work.back();
      work.pop_back();
      follow(at, seen, work);
    }
    return seen;
  }

 private:
  void follow(std::size_t at, std::vector<bool>& seen, std::vector<std::size_t>& work) const {
    const auto go = [&](std::size_t next) {
      if (next >= seen.size() || seen[next]) return;
      seen[next] = true;
      work.push_back(next);
    };
    const program::Instruction& in = program_.code[at];
    for (const program::Operand& operand : in.operands) {
      if (operand.kind == OperandKind::kLabel) go(operand.index);
    }
    if (in.op == Opcode::kReturn) {
      for (const std::size_t next : returns_to_) go(next);
    }
    if (in.op != Opcode::kJump && in.op != Opcode::kEnd && in.op != Opcode::kReturn) go(at + 1);
  }

  const Program& program_;
  std::vector<std::size_t> returns_to_;
};

}  // namespace

std::vector<ScalarRead> unwritten_reads(const Program& program, const std::vector<ScalarRead>& reads) {
  std::map<std::uint32_t, std::vector<std::size_t>> writes;
  for (std::size_t i = 0; i < program.code.size(); ++i) {
    const program::Operand& written = program.code[i].destination;
    if (written.kind == OperandKind::kVariable) writes[written.index].push_back(i);
  }
  const Reach reach(program);
  std::map<std::uint32_t, std::vector<bool>>
      reached;  // only of scalars that are read before their first write
  std::vector<ScalarRead> found;
  for (const ScalarRead& read : reads) {
    const std::vector<std::size_t>& all = writes[read.variable];
    if (!all.empty() && all.front() < read.position) continue;
    const auto [place, added] = reached.try_emplace(read.variable);
    if (added) place->second = reach.after(all);
    if (read.position >= place->second.size() || !place->second[read.position]) found.push_back(read);
  }
  return found;
}

}  // namespace apron::compiler

#include "apron/compiler/DefiniteAssignment.h"

#include <map>
#include <set>

namespace apron::compiler {
namespace {

using program::Opcode;
using program::OperandKind;
using program::Program;

class Reachability {
 public:
  explicit Reachability(const Program& program) : program_(program) {
    for (std::size_t i = 0; i < program.code.size(); ++i) {
      if (program.code[i].op == Opcode::kCall) return_sites_.push_back(i + 1);
    }
  }

  // The instructions that can run after one of these.
  std::vector<bool> reachable_from(const std::vector<std::size_t>& writes) const {
    std::vector<bool> seen(program_.code.size(), false);
    std::vector<std::size_t> work;
    for (const std::size_t write : writes) visit_successors(write, seen, work);
    while (!work.empty()) {
      const std::size_t index = work.back();
      work.pop_back();
      visit_successors(index, seen, work);
    }
    return seen;
  }

 private:
  void visit_successors(std::size_t index, std::vector<bool>& seen, std::vector<std::size_t>& work) const {
    const auto enqueue = [&](std::size_t next) {
      if (next >= seen.size() || seen[next]) return;
      seen[next] = true;
      work.push_back(next);
    };
    const program::Instruction& in = program_.code[index];
    for (const program::Operand& operand : in.operands) {
      if (operand.kind == OperandKind::kLabel) enqueue(operand.index);
    }
    if (in.op == Opcode::kReturn) {
      for (const std::size_t next : return_sites_) enqueue(next);
    }
    if (in.op != Opcode::kJump && in.op != Opcode::kEnd && in.op != Opcode::kReturn) enqueue(index + 1);
  }

  const Program& program_;
  std::vector<std::size_t> return_sites_;
};

}  // namespace

std::vector<ScalarRead> find_unassigned_reads(const Program& program, const std::vector<ScalarRead>& reads) {
  std::map<std::uint32_t, std::vector<std::size_t>> writes;
  for (std::size_t i = 0; i < program.code.size(); ++i) {
    const program::Operand& written = program.code[i].destination;
    if (written.kind == OperandKind::kVariable) writes[written.index].push_back(i);
  }
  const Reachability reachability(program);
  // Only for scalars that are read before their first write.
  std::map<std::uint32_t, std::vector<bool>> reached;
  std::vector<ScalarRead> found;
  for (const ScalarRead& read : reads) {
    const std::vector<std::size_t>& all = writes[read.variable];
    if (!all.empty() && all.front() < read.instruction) continue;
    const auto [entry, added] = reached.try_emplace(read.variable);
    if (added) entry->second = reachability.reachable_from(all);
    if (read.instruction >= entry->second.size() || !entry->second[read.instruction]) found.push_back(read);
  }
  return found;
}

}  // namespace apron::compiler

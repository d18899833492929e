#include "apron/compiler/DefiniteAssignment.h"

#include <algorithm>
#include <iterator>
#include <map>
#include <utility>

#include "apron/program/Reachability.h"

namespace apron::compiler {
namespace {

using program::Program;

// The instructions that can run after one of these.
std::vector<bool> reachable_after(const Program& program, const std::vector<std::size_t>& writes) {
  std::vector<std::size_t> return_sites;
  for (std::size_t i = 0; i < program.code.size(); ++i)
    if (program.code[i].op == program::Opcode::kCall) return_sites.push_back(i + 1);
  const auto edges = [&](std::size_t index) {
    return program.code[index].op == program::Opcode::kReturn ? return_sites
                                                              : program::successors(program, index);
  };
  std::vector<std::size_t> work;
  for (const std::size_t write : writes) std::ranges::copy(edges(write), std::back_inserter(work));
  return program::walk(program.code.size(), std::move(work), edges);
}

}  // namespace

std::vector<ScalarRead> find_unassigned_reads(const Program& program, const std::vector<ScalarRead>& reads) {
  std::map<std::uint32_t, std::vector<std::size_t>> writes;
  for (std::size_t i = 0; i < program.code.size(); ++i) {
    const program::Operand& written = program.code[i].destination;
    if (written.kind == program::OperandKind::kVariable) writes[written.index].push_back(i);
    if (program.code[i].op != program::Opcode::kResSetVar) continue;
    for (const std::uint32_t member : program.groups[program.code[i].operands[0].index].members)
      writes[member].push_back(i);
  }
  // Only for scalars that are read before their first write.
  std::map<std::uint32_t, std::vector<bool>> reached;
  std::vector<ScalarRead> found;
  for (const ScalarRead& read : reads) {
    const std::vector<std::size_t>& all = writes[read.variable];
    if (!all.empty() && all.front() < read.instruction) continue;
    const auto [entry, added] = reached.try_emplace(read.variable);
    if (added) entry->second = reachable_after(program, all);
    if (read.instruction >= entry->second.size() || !entry->second[read.instruction]) found.push_back(read);
  }
  return found;
}

}  // namespace apron::compiler

// Control-flow analysis: the instructions that a run can reach, whatever its conditions yield.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "apron/program/Program.h"

namespace apron::program {

// The instructions that may be executed after this one. A routine that is called is assumed to return.
std::vector<std::size_t> successors(const Program&, std::size_t instruction);

// The nodes of a graph of `size` nodes that a walk along the edges reaches: the nodes in `work` and, from
// each node, those that edges(node) returns.
template <typename Edges>
std::vector<bool> walk(std::size_t size, std::vector<std::size_t> work, const Edges& edges) {
  std::vector<bool> seen(size, false);
  while (!work.empty()) {
    const std::size_t index = work.back();
    work.pop_back();
    if (index >= size || seen[index]) continue;
    seen[index] = true;
    for (const std::size_t next : edges(index)) work.push_back(next);
  }
  return seen;
}

// True if some path from the first instruction executes this opcode. The program must pass verify().
bool can_reach(const Program&, Opcode);

// True if the program has an instruction that senses, actuates or steps.
bool uses_surface(const Program&);

// The first instruction that a run can reach and from which no path leads to surface.step or the end of the
// program: there it repeats forever and the surface waits. Empty if there is none. The program must pass
// verify().
std::optional<std::size_t> find_loop_without_step(const Program&);

// For a program that loops forever without surface.step, whatever its conditions yield: the last jump back
// that a run can reach. Empty if a run can reach surface.step or the end. The program must pass verify().
std::optional<std::size_t> find_endless_loop(const Program&);

}  // namespace apron::program

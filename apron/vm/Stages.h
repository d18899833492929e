// Which operations of a graph run together, over one row after another.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "apron/vm/Graph.h"

namespace apron::vm {

inline constexpr std::uint32_t kNoStage = UINT32_MAX;

// Who reads a value, and from how far.
struct Use {
  std::uint32_t node = 0;
  std::int8_t dx = 0, dy = 0;
};

struct Stages {
  using Group = std::vector<std::uint32_t>;  // nodes, in order

  std::vector<Group> groups;            // each after those that it reads from
  std::vector<std::uint32_t> stage_of;  // by node: its group; kNoStage for what is not computed
  std::vector<std::vector<Use>> users;  // by node
};

// A group takes at most kMaxStreams rows in and out, and its values fit into the vector registers.
Stages find_stages(const Graph& graph);

// Whether operations of this opcode may share a stage with others.
bool joins_stages(program::Opcode op) noexcept;

}  // namespace apron::vm

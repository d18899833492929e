// Partitions the operations of a graph into stages, each fused into one loop over rows.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "apron/vm/fusion/ValueGraph.h"

namespace apron::vm {

inline constexpr std::uint32_t kNoStage = UINT32_MAX;

// Who reads a value, and from how far.
struct ValueUse {
  std::uint32_t node = 0;
  std::int8_t dx = 0, dy = 0;
};

struct StagePartition {
  using NodeGroup = std::vector<std::uint32_t>;  // nodes, in order

  std::vector<NodeGroup> groups;             // each after those that it reads from
  std::vector<std::uint32_t> stage_of;       // by node: its group; kNoStage for what is not computed
  std::vector<std::vector<ValueUse>> users;  // by node
};

// A group takes at most kMaxStreams rows in and out, and its values fit into the vector registers.
StagePartition partition_stages(const ValueGraph& graph);

// Whether operations of this opcode may share a stage with others.
bool is_fusible_opcode(program::Opcode op) noexcept;

}  // namespace apron::vm

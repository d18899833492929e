// Partitions the operations of a graph into stages, each fused into one loop over rows.
#pragma once

#include <cstdint>
#include <vector>

#include "apron/vm/fusion/ValueGraph.h"

namespace apron::vm {

inline constexpr std::uint32_t kNoStage = UINT32_MAX;

// One use of a value: the node that reads it, and the offset at which it reads.
struct ValueUse {
  std::uint32_t node = 0;
  std::int8_t dx = 0, dy = 0;
};

struct StagePartition {
  using NodeGroup = std::vector<std::uint32_t>;  // node indices, ascending

  std::vector<NodeGroup> groups;             // in topological order
  std::vector<std::uint32_t> stage_of;       // indexed by node: its group, or kNoStage for inputs
  std::vector<std::vector<ValueUse>> users;  // indexed by node
};

// Each group of more than one node reads and writes at most kMaxStreams rows, and its live values fit into
// the vector registers.
StagePartition partition_stages(const ValueGraph& graph);

}  // namespace apron::vm

#include "apron/vm/fusion/NonTemporalStores.h"

#include <algorithm>

namespace apron::vm {
namespace {

constexpr std::size_t kLastLevelCacheBytes = std::size_t{32} * 1024 * 1024;

bool reads_stream(const Stage& stage, std::uint32_t stream) {
  return std::ranges::any_of(stage.ops, [&](const MicroOp& op) {
    return std::ranges::any_of(op.operands, [&](const MicroOperand& arg) {
      return arg.kind == MicroOperand::Kind::kStream && arg.index == stream;
    });
  });
}

// True if a stage reads the plane's new values or, for an in-place result, its old ones.
bool is_read_by_stage(const std::vector<Stage>& stages, const std::vector<RowBuffer>& buffers,
                      const RowBuffer& plane) {
  for (const Stage& stage : stages)
    for (std::uint32_t s = 0; s < stage.streams.size(); ++s) {
      const RowBuffer& buffer = buffers[stage.streams[s].buffer];
      const bool old = plane.kind == RowBuffer::Kind::kInPlace && buffer.kind == RowBuffer::Kind::kRegister;
      if (buffer.reg == plane.reg && (old || buffer.kind == plane.kind) && reads_stream(stage, s))
        return true;
    }
  return false;
}

}  // namespace

void select_non_temporal_stores(std::vector<Stage>& stages, const std::vector<RowBuffer>& buffers,
                                std::size_t bytes) {
  const std::size_t planes = std::ranges::count_if(
      buffers, [](const RowBuffer& store) { return store.kind != RowBuffer::Kind::kRing; });
  if (planes * bytes <= kLastLevelCacheBytes) return;
  for (Stage& stage : stages)
    for (Stage::Result& result : stage.results) {
      const RowBuffer& to = buffers[stage.streams[result.stream].buffer];
      result.non_temporal = to.kind != RowBuffer::Kind::kRing && !is_read_by_stage(stages, buffers, to);
    }
}

}  // namespace apron::vm

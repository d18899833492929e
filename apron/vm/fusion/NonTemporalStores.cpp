#include "apron/vm/fusion/NonTemporalStores.h"

#include <algorithm>

namespace apron::vm {
namespace {

constexpr std::size_t kLastLevelCacheFloats = 32 * 1024 * 1024 / sizeof(float);

bool reads_stream(const Stage& stage, std::uint32_t stream) {
  return std::ranges::any_of(stage.ops, [&](const MicroOp& op) {
    return std::ranges::any_of(op.operands, [&](const MicroOperand& arg) {
      return arg.kind == MicroOperand::Kind::kStream && arg.index == stream;
    });
  });
}

// True if a stage reads the plane's new values or, for an in-place result, its old ones.
bool is_read_by_stage(const FusionPlan& plan, const RowBuffer& plane) {
  for (const Stage& stage : plan.stages)
    for (std::uint32_t s = 0; s < stage.streams.size(); ++s) {
      const RowBuffer& buffer = plan.buffers[stage.streams[s].buffer];
      const bool old = plane.kind == RowBuffer::Kind::kInPlace && buffer.kind == RowBuffer::Kind::kRegister;
      if (buffer.reg == plane.reg && (old || buffer.kind == plane.kind) && reads_stream(stage, s))
        return true;
    }
  return false;
}

}  // namespace

void select_non_temporal_stores(FusionPlan& plan) {
  const auto planes = std::ranges::count_if(
      plan.buffers, [](const RowBuffer& store) { return store.kind != RowBuffer::Kind::kRing; });
  const std::size_t floats = static_cast<std::size_t>(planes) * plan.width * plan.height;
  if (floats <= kLastLevelCacheFloats) return;
  for (Stage& stage : plan.stages)
    for (Stage::Result& result : stage.results) {
      const RowBuffer& to = plan.buffers[stage.streams[result.stream].buffer];
      result.non_temporal = to.kind != RowBuffer::Kind::kRing && !is_read_by_stage(plan, to);
    }
}

}  // namespace apron::vm

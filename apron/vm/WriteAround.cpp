#include "apron/vm/WriteAround.h"

#include <algorithm>

namespace apron::vm {
namespace {

constexpr std::size_t kAllCachesFloats = 32 * 1024 * 1024 / sizeof(float);

bool reads(const Stage& stage, std::uint32_t stream) {
  return std::any_of(stage.ops.begin(), stage.ops.end(), [&](const MicroOp& op) {
    return std::any_of(op.args.begin(), op.args.end(), [&](const MicroArg& arg) {
      return arg.kind == MicroArg::Kind::kStream && arg.index == stream;
    });
  });
}

// Whether a stage reads what is written to the plane, or what was there before.
bool is_read(const Plan& plan, const Store& plane) {
  for (const Stage& stage : plan.stages)
    for (std::uint32_t s = 0; s < stage.streams.size(); ++s) {
      const Store& store = plan.stores[stage.streams[s].store];
      const bool old = plane.kind == Store::Kind::kInPlace && store.kind == Store::Kind::kRegister;
      if (store.reg == plane.reg && (old || store.kind == plane.kind) && reads(stage, s)) return true;
    }
  return false;
}

}  // namespace

void write_around_caches(Plan& plan) {
  const auto planes = std::count_if(plan.stores.begin(), plan.stores.end(),
                                    [](const Store& store) { return store.kind != Store::Kind::kRing; });
  const std::size_t floats = static_cast<std::size_t>(planes) * plan.width * plan.height;
  if (floats <= kAllCachesFloats) return;
  for (Stage& stage : plan.stages)
    for (Stage::Result& result : stage.results) {
      const Store& to = plan.stores[stage.streams[result.stream].store];
      result.around_caches = to.kind != Store::Kind::kRing && !is_read(plan, to);
    }
}

}  // namespace apron::vm

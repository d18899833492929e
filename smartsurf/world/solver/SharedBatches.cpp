#include "smartsurf/world/solver/SharedBatches.h"

#include <algorithm>
#include <atomic>

namespace smartsurf::world {

void SharedBatches::resize(int rows, int member_count) {
  is_shared_row_.resize(rows);
  member_batches_.resize(member_count);
}

void SharedBatches::clear_marks(IndexRange own_rows) {
  std::fill(is_shared_row_.begin() + own_rows.begin, is_shared_row_.begin() + own_rows.end, std::uint8_t{0});
}

void SharedBatches::mark_foreign_rows(const ContactBatch& o, IndexRange own_rows) {
  if (member_batches_.size() == 1) return;
  for (const std::int32_t* rows : {o.a, o.b})
    for (int lane = 0; lane < kLanes; ++lane)
      if (rows[lane] < own_rows.begin || rows[lane] >= own_rows.end)
        // Atomic, because several members may mark the same row.
        std::atomic_ref(is_shared_row_[rows[lane]]).store(1, std::memory_order_relaxed);
}

bool SharedBatches::touches_shared_row(const ContactBatch& o) const {
  std::uint8_t any = 0;
  for (int lane = 0; lane < kLanes; ++lane) any |= is_shared_row_[o.a[lane]] | is_shared_row_[o.b[lane]];
  return any != 0;
}

void SharedBatches::split_batches(const ConstraintGraph& graph, const Member& member) {
  MemberBatches& batches = member_batches_[member.index];
  batches.shared.clear();
  batches.own.clear();
  for (int i = 0; i <= graph.colour_count(); ++i) {
    for (const BatchRange& run : graph.own_batches(member, i))
      for (int o = run.first; o < run.first + run.count; ++o) {
        auto& list = touches_shared_row(graph.batch(o)) ? batches.shared : batches.own;
        list.append({run.kind, o, 1});
      }
    batches.shared.end_colour();
    batches.own.end_colour();
  }
}

}  // namespace smartsurf::world

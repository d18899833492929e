// Splits each member's contact batches into those that move bodies of other members and those that do not.
//
// A member solves its shared batches first in each colour and then arrives at the barrier, so that others
// wait for the shared batches only.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "smartsurf/world/parallel/Team.h"
#include "smartsurf/world/solver/ConstraintGraph.h"

namespace smartsurf::world {

class SharedBatches {
 public:
  // ---- set-up, in this order, with a barrier for all members after each
  // On one thread.
  void resize(int rows, int member_count);
  void clear_marks(IndexRange own_rows);
  // For each batch of a member, once its bodies are set: marks the rows that belong to other members.
  void mark_foreign_rows(const ContactBatch&, IndexRange own_rows);
  void split_batches(const ConstraintGraph&, const Member&);

  // The member's batches of the i-th colour, or of its static contacts if i is the number of colours: those
  // with a body that another member moves too, and the others.
  std::span<const BatchRange> shared(const Member& member, std::size_t i) const {
    return member_batches_[member.index].shared.of(i);
  }
  std::span<const BatchRange> own(const Member& member, std::size_t i) const {
    return member_batches_[member.index].own.of(i);
  }

 private:
  struct alignas(128) MemberBatches {
    BatchRangesByColour shared, own;
  };
  bool touches_shared_row(const ContactBatch&) const;

  // Indexed by row: whether a member other than its owner moves the body.
  std::vector<std::uint8_t> is_shared_row_;
  std::vector<MemberBatches> member_batches_;  // one per member
};

}  // namespace smartsurf::world

// Where the members' parts of the table touch: rows of bodies that octets of more than one member move, and
// which octets those are. A member solves these first in each pass of a colour and tells; the others wait for
// no more than that.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "smartsurf/world/parallel/Team.h"
#include "smartsurf/world/solver/ConstraintGraph.h"

namespace smartsurf::world {

class SharedBatches {
 public:
  // ---- one after the other, and between them all members meet
  void resize(int rows, int member_count);
  void clear_marks(IndexRange own_rows);
  // Of each octet of a member, once it has its bodies: what of it lies in the rows of others.
  void mark_foreign_rows(const ContactBatch&, IndexRange own_rows);
  void split_batches(const ConstraintGraph&, const Member&);

  // The member's octets of the i-th colour, or, after the last, those with the world: the ones that move what
  // others move too, and the rest.
  std::span<const BatchRange> shared(const Member& member, std::size_t i) const {
    return member_batches_[static_cast<std::size_t>(member.index)].shared.of(i);
  }
  std::span<const BatchRange> own(const Member& member, std::size_t i) const {
    return member_batches_[static_cast<std::size_t>(member.index)].own.of(i);
  }

 private:
  struct alignas(128) MemberBatches {
    BatchRangesByColour shared, own;
  };
  bool touches_shared_row(const ContactBatch&) const;

  std::vector<std::uint8_t> is_shared_row_;    // of each row, whether others move it
  std::vector<MemberBatches> member_batches_;  // one a member
};

}  // namespace smartsurf::world

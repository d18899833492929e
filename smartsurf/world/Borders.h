// Where the members' parts of the table touch: rows of bodies that octets of more than one member move, and
// which octets those are. A member solves these first in each pass of a colour and tells; the others wait for
// no more than that.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "smartsurf/world/Schedule.h"
#include "smartsurf/world/Team.h"

namespace smartsurf::world {

class Borders {
 public:
  // ---- one after the other, and between them all members meet
  void make_room(int rows, int members);
  void clear(Range own_rows);
  // Of each octet of a member, once it has its bodies: what of it lies in the rows of others.
  void mark(const Octet&, Range own_rows);
  void split(const Schedule&, const Member&);

  // The member's octets of the i-th colour, or, after the last, those with the world: the ones that move what
  // others move too, and the rest.
  std::span<const OctetRun> shared(const Member& member, std::size_t i) const {
    return part_[static_cast<std::size_t>(member.index)].shared.of(i);
  }
  std::span<const OctetRun> own(const Member& member, std::size_t i) const {
    return part_[static_cast<std::size_t>(member.index)].own.of(i);
  }

 private:
  struct alignas(128) Part {
    OctetRuns shared, own;
  };
  bool touches(const Octet&) const;

  std::vector<std::uint8_t> marked_;  // of each row, whether others move it
  std::vector<Part> part_;            // one a member
};

}  // namespace smartsurf::world

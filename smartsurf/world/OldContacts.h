// The contacts of the last step, by body. Each member of the team indexes those that it found, and asks
// itself first: most are where they were.
#pragma once

#include <vector>

#include "smartsurf/world/Contact.h"
#include "smartsurf/world/Slabs.h"
#include "smartsurf/world/Team.h"

namespace smartsurf::world {

class OldContacts {
 public:
  // Takes the last step's lists over and gives two to fill again.
  void take(ContactList& pairs, ContactList& world, int members);
  // All members together, then they meet; the runs are still the last step's.
  void index(std::size_t bodies, const SlabRuns& pair_runs, const SlabRuns& world_runs, const Member&);
  // In which slabs the member finds the new ones.
  void found(Range slabs, const Member& member) {
    index_[static_cast<std::size_t>(member.index)].slabs = slabs;
  }

  const ContactList& pairs() const { return pairs_; }
  const ContactList& world() const { return world_; }
  // The manifold that the two had, or one and the world, or −1. `member`: who asks.
  int pair(std::size_t a, std::size_t b, int member) const;
  int with_world(std::size_t body, int member) const;
  // The normal of a contact that a body had with a fixed one, or null.
  const Vec3* normal(std::size_t body, std::size_t fixed, int member) const;

 private:
  struct alignas(128) Index {
    Range slabs{0, 0};                            // in which the member found them
    std::vector<std::int32_t> first_pair, world;  // of each body, as a; −1: none
  };
  template <class Each>
  void for_own(const ContactList&, const SlabRuns&, const Member&, Each each) const;

  ContactList pairs_, world_;
  std::vector<Index> index_;        // one a member
  std::vector<std::int32_t> next_;  // of each pair: the next one with the same a, of the same member
  bool same_members_ = false;       // as in the last step
};

}  // namespace smartsurf::world

// The contacts of the last step, by body. Each member of the team indexes those that it found, and asks
// itself first: most are where they were.
#pragma once

#include <vector>

#include "smartsurf/world/Contact.h"
#include "smartsurf/world/parallel/SpatialPartition.h"
#include "smartsurf/world/parallel/Team.h"

namespace smartsurf::world {

class PreviousContacts {
 public:
  // Takes the last step's lists over and gives two to fill again.
  void swap_lists(ContactList& pair_contacts, ContactList& static_contacts, int member_count);
  // All members together, then they meet; the runs are still the last step's.
  void build_index(std::size_t bodies, const SlabRanges& pair_ranges, const SlabRanges& static_ranges,
                   const Member&);
  // In which slabs the member finds the new ones.
  void set_own_slabs(IndexRange slabs, const Member& member) {
    index_[static_cast<std::size_t>(member.index)].slabs = slabs;
  }

  const ContactList& pair_contacts() const { return pair_contacts_; }
  const ContactList& static_contacts() const { return static_contacts_; }
  // The manifold that the two had, or one and the world, or −1. `member`: who asks.
  int find_pair(std::size_t a, std::size_t b, int member) const;
  int find_static(std::size_t body, int member) const;
  // The normal of a contact that a body had with a fixed one, or null.
  const Vec3* find_static_normal(std::size_t body, std::size_t static_body, int member) const;

 private:
  struct alignas(128) Index {
    IndexRange slabs{0, 0};                                 // in which the member found them
    std::vector<std::int32_t> first_pair, static_manifold;  // of each body, as a; −1: none
  };
  template <class Each>
  void for_each_own(const ContactList&, const SlabRanges&, const Member&, Each each) const;

  ContactList pair_contacts_, static_contacts_;
  std::vector<Index> index_;             // one a member
  std::vector<std::int32_t> next_pair_;  // of each pair: the next one with the same a, of the same member
  bool same_member_count_ = false;       // as in the last step
};

}  // namespace smartsurf::world

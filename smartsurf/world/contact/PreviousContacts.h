// The contacts of the previous step, indexed by body, for warm starting.
//
// Each member of the team indexes the manifolds that it found itself, and searches its own index first: most
// bodies stay in the slabs of the same member.
#pragma once

#include <vector>

#include "smartsurf/world/body/BodyMap.h"
#include "smartsurf/world/broadphase/SpatialPartition.h"
#include "smartsurf/world/contact/Contact.h"
#include "smartsurf/world/parallel/Team.h"

namespace smartsurf::world {

class PreviousContacts {
 public:
  // Takes over the previous step's lists and returns older ones, whose memory can be reused. Call from one
  // thread, before build_index().
  void swap_lists(ContactList& pair_contacts, ContactList& static_contacts, int member_count);
  // Builds the member's part of the index. Called by all members; they must meet at a barrier before the
  // first find. The ranges are those of the previous step.
  void build_index(std::size_t bodies, const SlabRanges& pair_ranges, const SlabRanges& static_ranges,
                   const Member&);
  // The slabs in which the member finds the contacts of this step, for the next build_index().
  void set_own_slabs(IndexRange slabs, const Member& member) { index_[member.index].slabs = slabs; }

  // Call when the lists to be taken over next are not those of the previous step: the slabs no longer show
  // who found which manifold.
  void forget_slabs() { index_.clear(); }

  const ContactList& pair_contacts() const { return pair_contacts_; }
  const ContactList& static_contacts() const { return static_contacts_; }
  // Index of the manifold of a pair (a < b), or of a body's static contacts, in its list; −1 if there was
  // none. `member`: index of the calling member. `expected`: where the pair is looked for first; becomes the
  // position after the one found, because pairs come in much the same order in each step.
  int find_pair(std::size_t a, std::size_t b, int member, int& expected) const;
  int find_static(std::size_t body, int member) const;
  // The normal of a contact between the body and a static body, or null. Valid until swap_lists().
  const Vec3* find_static_normal(std::size_t body, std::size_t static_body, int member) const;

 private:
  struct alignas(128) MemberIndex {
    IndexRange slabs{0, 0};                                     // in which the member found its manifolds
    BodyMap<std::int32_t> first_pair{-1}, static_manifold{-1};  // by body a; −1 if none
  };
  template <class Each>
  void for_each_own(const ContactList&, const SlabRanges&, const Member&, Each each) const;

  ContactList pair_contacts_, static_contacts_;
  std::vector<MemberIndex> index_;       // one per member
  std::vector<std::int32_t> next_pair_;  // linked list: next pair with the same a in the same member's index
  bool same_member_count_ = false;       // as in the previous step
};

}  // namespace smartsurf::world

#include "smartsurf/world/contact/PreviousContacts.h"

#include <cassert>
#include <utility>

namespace smartsurf::world {

void PreviousContacts::swap_lists(ContactList& pair_contacts, ContactList& static_contacts,
                                  int member_count) {
  std::swap(pair_contacts_, pair_contacts);
  std::swap(static_contacts_, static_contacts);
  same_member_count_ = std::ssize(index_) == member_count;
  index_.resize(member_count);
  next_pair_.resize(pair_contacts_.manifolds.size());
}

// Calls each(index) for the manifolds that the member found. If manifolds were added or removed since (sleep,
// removed bodies), the slab ranges no longer match the list and the member takes an even share of it instead.
template <class Each>
void PreviousContacts::for_each_own(const ContactList& list, const SlabRanges& ranges, const Member& member,
                                    Each each) const {
  auto for_range = [&](IndexRange range) {
    assert(range.end <= std::ssize(list.manifolds));
    for (Index i = range.begin; i < range.end; ++i) each(i);
  };
  const int count = static_cast<int>(list.manifolds.size());
  for_range(same_member_count_ && ranges.manifold_count() == count ? ranges.of(index_[member.index].slabs)
                                                                   : member.share(count));
}

void PreviousContacts::build_index(std::size_t bodies, const SlabRanges& pair_ranges,
                                   const SlabRanges& static_ranges, const Member& member) {
  MemberIndex& own_index = index_[member.index];
  own_index.first_pair.clear(bodies);
  own_index.static_manifold.clear(bodies);
  for_each_own(pair_contacts_, pair_ranges, member, [&](Index i) {
    const Index a = pair_contacts_.manifolds[i].a;
    next_pair_[i] = own_index.first_pair[a];
    own_index.first_pair.set(a, static_cast<std::int32_t>(i));
  });
  for_each_own(static_contacts_, static_ranges, member, [&](Index i) {
    own_index.static_manifold.set(static_contacts_.manifolds[i].a, static_cast<std::int32_t>(i));
  });
}

int PreviousContacts::find_pair(std::size_t a, std::size_t b, int member, int& expected) const {
  if (const Index i = expected; i < std::ssize(pair_contacts_.manifolds)) {
    const Manifold& m = pair_contacts_.manifolds[i];
    if (m.a == static_cast<std::int32_t>(a) && m.b == static_cast<std::int32_t>(b)) return expected++;
  }
  for (std::size_t k = 0; k < index_.size(); ++k) {
    int manifold = index_[(member + k) % index_.size()].first_pair[a];
    while (manifold >= 0 && pair_contacts_.manifolds[manifold].b != static_cast<std::int32_t>(b))
      manifold = next_pair_[manifold];
    if (manifold < 0) continue;
    expected = manifold + 1;
    return manifold;
  }
  return -1;
}

int PreviousContacts::find_static(std::size_t body, int member) const {
  for (std::size_t k = 0; k < index_.size(); ++k) {
    const int manifold = index_[(member + k) % index_.size()].static_manifold[body];
    if (manifold >= 0) return manifold;
  }
  return -1;
}

const Vec3* PreviousContacts::find_static_normal(std::size_t body, std::size_t static_body,
                                                 int member) const {
  const int manifold = find_static(body, member);
  if (manifold < 0) return nullptr;
  for (const Contact& c : static_contacts_.contacts_of(static_contacts_.manifolds[manifold]))
    if (c.partner == Partner{static_cast<std::int32_t>(static_body)}) return &c.normal;
  return nullptr;
}

}  // namespace smartsurf::world

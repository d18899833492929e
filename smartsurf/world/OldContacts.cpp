#include "smartsurf/world/OldContacts.h"

#include <cassert>
#include <utility>

namespace smartsurf::world {

void OldContacts::take(ContactList& pairs, ContactList& world, int members) {
  std::swap(pairs_, pairs);
  std::swap(world_, world);
  same_members_ = index_.size() == static_cast<std::size_t>(members);
  index_.resize(static_cast<std::size_t>(members));
  next_.resize(pairs_.manifolds.size());
}

// Calls each(index) for the manifolds that the member found, or, where some came or went since and nobody
// knows which those are, for its share of them.
template <class Each>
void OldContacts::for_own(const ContactList& list, const SlabRuns& runs, const Member& member,
                          Each each) const {
  auto for_range = [&](Range range) {
    assert(range.end <= static_cast<int>(list.manifolds.size()));
    for (auto i = static_cast<std::size_t>(range.begin); i < static_cast<std::size_t>(range.end); ++i)
      each(i);
  };
  if (!same_members_ || runs.manifolds != list.manifolds.size())
    return for_range(member.share(static_cast<int>(list.manifolds.size())));
  for (const Range& run : runs.of(index_[static_cast<std::size_t>(member.index)].slabs)) for_range(run);
}

void OldContacts::index(std::size_t bodies, const SlabRuns& pair_runs, const SlabRuns& world_runs,
                        const Member& member) {
  Index& index = index_[static_cast<std::size_t>(member.index)];
  index.first_pair.assign(bodies, -1);
  index.world.assign(bodies, -1);
  for_own(pairs_, pair_runs, member, [&](std::size_t i) {
    std::int32_t& first = index.first_pair[static_cast<std::size_t>(pairs_.manifolds[i].a)];
    next_[i] = first;
    first = static_cast<std::int32_t>(i);
  });
  for_own(world_, world_runs, member, [&](std::size_t i) {
    index.world[static_cast<std::size_t>(world_.manifolds[i].a)] = static_cast<std::int32_t>(i);
  });
}

int OldContacts::pair(std::size_t a, std::size_t b, int member) const {
  for (std::size_t k = 0; k < index_.size(); ++k) {
    int old = index_[(static_cast<std::size_t>(member) + k) % index_.size()].first_pair[a];
    while (old >= 0 && pairs_.manifolds[static_cast<std::size_t>(old)].b != static_cast<std::int32_t>(b))
      old = next_[static_cast<std::size_t>(old)];
    if (old >= 0) return old;
  }
  return -1;
}

int OldContacts::with_world(std::size_t body, int member) const {
  for (std::size_t k = 0; k < index_.size(); ++k) {
    const int old = index_[(static_cast<std::size_t>(member) + k) % index_.size()].world[body];
    if (old >= 0) return old;
  }
  return -1;
}

const Vec3* OldContacts::normal(std::size_t body, std::size_t fixed, int member) const {
  const int manifold = with_world(body, member);
  if (manifold < 0) return nullptr;
  const Manifold& m = world_.manifolds[static_cast<std::size_t>(manifold)];
  for (int k = m.first; k < m.first + m.count; ++k) {
    const Contact& c = world_.contacts[static_cast<std::size_t>(k)];
    if (c.other == static_cast<std::int32_t>(fixed)) return &c.normal;
  }
  return nullptr;
}

}  // namespace smartsurf::world

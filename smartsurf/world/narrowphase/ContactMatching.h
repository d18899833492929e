// Which contacts of a step were there in the previous one: they begin with its impulses (warm starting).
#pragma once

#include <span>

#include "smartsurf/world/contact/Contact.h"
#include "smartsurf/world/narrowphase/PairManifoldCache.h"

namespace smartsurf::world {

// Each current contact takes the impulses of the nearest previous contact within `tolerance` (distance of
// anchors, u) with the same partner; each previous contact is used once. `manifold`: index in `previous`, or
// −1.
void match_contacts(ContactList&, const Manifold& current, const ContactList& previous, int manifold,
                    float tolerance);

// As match_contacts() between two bodies, for a manifold that was kept and whose points all had contacts in
// the last step: these are known by their points, unless one has moved so far that another may be nearer.
// Returns false and does nothing then.
bool match_points(std::span<Contact>, std::span<const Contact> previous, const PairManifoldCache::Points&,
                  float tolerance);

}  // namespace smartsurf::world

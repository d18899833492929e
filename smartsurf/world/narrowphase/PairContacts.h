// Contacts of two bodies of any shape.
#pragma once

#include <vector>

#include "smartsurf/world/body/BodyStore.h"
#include "smartsurf/world/contact/Contact.h"
#include "smartsurf/world/narrowphase/ConvexPair.h"

namespace smartsurf::world {

// Appends the contacts of bodies a and b, normals from b to a: those with separations up to `margin`, and
// speculative ones that the bodies can close within one step. Ignores sleep and mass. `cached_normal`: normal
// of a contact of the previous step, or null; affects speed only.
void collide_bodies(const BodyStore&, std::size_t a, std::size_t b, float margin, float dt_s,
                    const Vec3* cached_normal, std::vector<Contact>& out);

// Appends the contacts of two shapes with separations up to `margin`, normals from b to a and anchors from
// a's origin.
void collide_placed(const PlacedShape& a, const PlacedShape& b, float margin, std::vector<Contact>& out);

// Distance by which the centres approach each other within one step, u.
float closing_distance(const BodyStore&, std::size_t a, std::size_t b, float dt_s);

}  // namespace smartsurf::world

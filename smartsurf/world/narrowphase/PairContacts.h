// Contacts of two bodies of any shape.
#pragma once

#include <span>
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

// Finds the contacts that close within the step, as the bodies move now. Those of two spheres get the normal
// and the point at which these will meet; the others get their time to it, negative until move_to_meeting():
// seams are corrected where the points are at the start of the step. Anchors are from a's origin.
void predict_meetings(const BodyStore&, std::size_t a, std::size_t b, float dt_s, std::span<Contact>);

// Moves the point of such a contact to where the bodies will meet.
void move_to_meeting(const BodyStore&, std::size_t a, std::size_t b, Contact&);

// When spheres whose centres are at `distance` from each other touch, as a fraction of a movement relative to
// each other; above 1 or infinite: not within it.
float fraction_until_contact(const Vec3& distance, float separation, float radii, const Vec3& movement);

// Distance by which the centres approach each other within one step, u.
float closing_distance(const BodyStore&, std::size_t a, std::size_t b, float dt_s);

}  // namespace smartsurf::world

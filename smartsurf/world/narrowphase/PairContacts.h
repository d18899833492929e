// Where two bodies touch.
#pragma once

#include <vector>

#include "smartsurf/world/BodyStore.h"
#include "smartsurf/world/Contact.h"

namespace smartsurf::world {

// Appends the contacts of body a with body b, the normal pointing from b to a: all with gaps up to `margin`,
// and those whose gap the two would close within one step at their speed. Does not look at sleep or mass.
// `last_normal`: of a contact that the two had in the last step, or null. It saves work and decides nothing.
void collide_bodies(const BodyStore&, std::size_t a, std::size_t b, float margin, float dt_s,
                    const Vec3* cached_normal, std::vector<Contact>& out);

// How far the two close in on each other within one step, their centres' line taken for the normal.
float closing_distance(const BodyStore&, std::size_t a, std::size_t b, float dt_s);

}  // namespace smartsurf::world

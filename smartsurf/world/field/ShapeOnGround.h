// Contacts of a shape with the infinite ground plane.
#pragma once

#include <vector>

#include "smartsurf/world/Contact.h"
#include "smartsurf/world/narrowphase/Shape.h"

namespace smartsurf::world {

// Appends at most four contacts per convex part with the plane z = ground_height, with separations up to
// `margin`.
void collide_shape_with_ground(const Shape&, const Vec3& centre, const Mat3& axes, float ground_height,
                               float margin, std::vector<Contact>& out);

}  // namespace smartsurf::world

// Where a body touches the endless floor.
#pragma once

#include <vector>

#include "smartsurf/world/Contact.h"
#include "smartsurf/world/narrowphase/Shape.h"

namespace smartsurf::world {

// Appends at most four contacts for each convex piece with the floor at height `ground`; any shape.
void collide_shape_with_ground(const Shape&, const Vec3& centre, const Mat3& axes, float ground_height,
                               float margin, std::vector<Contact>& out);

}  // namespace smartsurf::world

// Where a body that is no sphere touches the field, or the ground.
#pragma once

#include <vector>

#include "smartsurf/world/Columns.h"
#include "smartsurf/world/Contact.h"
#include "smartsurf/world/Shape.h"

namespace smartsurf::world {

// Appends at most four contacts for each convex piece, chosen to hold it: the deepest first, then those that
// widen the support. Cells are bottomless columns, bridged as for spheres (SphereOnField.h).
void touch_field_with_shape(const surface::Field&, const Shape&, const Vec3& centre, const Mat3& axes,
                            float margin, std::vector<Contact>& out);

// The endless floor at height `ground`; any shape.
void touch_ground(const Shape&, const Vec3& centre, const Mat3& axes, float ground, float margin,
                  std::vector<Contact>& out);

}  // namespace smartsurf::world

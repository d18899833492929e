// Where a sphere touches the field, in closed form.
//
// A cell is a bottomless column with a rectangular top. Two neighbours whose tops are level are bridged: the
// gap between them belongs half to each, and no contact may lean out over a bridged side. So a level field is
// one flat plane, on which nothing snags; a sphere too small to bridge a gap falls into it.
#pragma once

#include <vector>

#include "smartsurf/world/Contact.h"
#include "smartsurf/world/field/Columns.h"

namespace smartsurf::world {

// Appends the deepest contact of each compass quadrant and the one straight below, at most four: what wedges
// a sphere in a pocket from all sides, where the four deepest alone may all stand on one side. `margin`:
// contacts up to that gap are found before they touch, ≥ 0.
void collide_sphere_with_field(const surface::Field&, const Vec3& centre, float radius, float margin,
                               std::vector<Contact>& out);

// Enters the velocity of the cell's surface at a point, and its turning, in the contact, whose normal is
// known.
void set_surface_velocity(const Columns&, int row, int column, const Vec3& point, Contact&);

}  // namespace smartsurf::world

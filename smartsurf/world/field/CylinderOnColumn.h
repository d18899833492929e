// Closest points of a cylinder and the upper edges of a column, in closed form.
#pragma once

#include "smartsurf/world/field/Columns.h"
#include "smartsurf/world/narrowphase/Gjk.h"

namespace smartsurf::world {

// Between the cylinder's core and the column shrunk by convex_radius. `towards`: approximate direction from
// the column to the cylinder. False if the closest feature may not be an upper edge or corner of the column,
// or if the two overlap.
bool closest_on_edges(const ConvexProxy& cylinder, const Column&, float convex_radius, const Vec3& towards,
                      ClosestPoints& out);

}  // namespace smartsurf::world

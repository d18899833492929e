// The nearest points of a cylinder and the upper edges of a column.
#pragma once

#include "smartsurf/world/field/Columns.h"
#include "smartsurf/world/narrowphase/Gjk.h"

namespace smartsurf::world {

// Of the core of a cylinder and a column drawn in by `rounding`, whose `towards` leads roughly to the
// cylinder. False where what is nearest may be no upper edge or corner of the column, or where the two
// overlap.
bool closest_on_edges(const ConvexProxy& cylinder, const Column&, float convex_radius, const Vec3& towards,
                      ClosestPoints& out);

}  // namespace smartsurf::world

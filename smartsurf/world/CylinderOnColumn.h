// Where a cylinder is nearest to the top of an upright column, without GJK.
#pragma once

#include <optional>

#include "smartsurf/world/Columns.h"
#include "smartsurf/world/Gjk.h"

namespace smartsurf::world {

// The nearest points of the cores, to 1e-4 u: `on_a` is the cylinder's. The column is drawn in by `rounding`
// at its top and sides. None where the column's sides are nearer below their upper edges, or the cores
// overlap.
std::optional<NearestPoints> nearest_on_top(const Core& cylinder, const Column&, float rounding);

}  // namespace smartsurf::world

// How deep an object that is no sphere stands in pins, told by points and closed forms alone: nothing of the
// engine's search for contacts takes part.
#pragma once

#include <vector>

#include "smartsurf/world/narrowphase/Distance.h"
#include "tests/bench/PinScene.h"

// The deepest of its corners, or points of its rims, in a pin, and of points along the edges of the pins'
// tops in it, u. `centre`: of mass; heights of all pins, row 0 north.
double max_shape_penetration(const pin_scene::Workload&, const smartsurf::world::Shape&,
                             const smartsurf::world::Vec3& centre, const smartsurf::world::Mat3& axes,
                             const std::vector<float>& heights);

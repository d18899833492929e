// Computes the penetration of a non-sphere into pins from sample points and closed forms, independently of
// the engine's collision detection.
#pragma once

#include <vector>

#include "smartsurf/world/narrowphase/Distance.h"
#include "tests/bench/PinScene.h"

// The maximum depth, in u, of the shape's corners and rim points in a pin and of points on the edges of the
// pins' tops in the shape. centre: centre of mass; heights: of all pins, row-major, row 0 north.
double max_shape_penetration(const pin_scene::Workload&, const smartsurf::world::Shape&,
                             const smartsurf::world::Vec3& centre, const smartsurf::world::Mat3& axes,
                             const std::vector<float>& heights);

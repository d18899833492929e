// flood, distance and spread.max: one-step rules of the four direct neighbours at their fixed point, found in
// fewer steps than by iterating them. Nothing beyond the edge takes part, but that distance counts it as
// background.
#pragma once

#include "apron/vm/Plane.h"

namespace apron::vm {

// All planes have one shape; y is none of the sources, and all its cells are written. No allocation.
// 1 in the cells of mask that are 4-connected within it to a cell where seed is non-zero too, else 0.
void flood(Plane y, ConstPlane seed, ConstPlane mask) noexcept;
// Steps to the nearest cell where a is 0, or to beyond the edge.
void distance(Plane y, ConstPlane a) noexcept;
// The largest a of the 4-connected part of mask that the cell is in; 0 outside mask.
void spread_max(Plane y, ConstPlane a, ConstPlane mask) noexcept;

}  // namespace apron::vm

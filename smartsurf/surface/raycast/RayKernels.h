// SIMD loops that cast the rays of all cells against bodies and pins. Private to smartsurf/surface/raycast.
#pragma once

#include <functional>

#include "smartsurf/surface/raycast/RayCastJob.h"

namespace smartsurf::surface {

// Casts the rays of these rows (grid rows from the north, or strips) against all bodies. Calls
// prepare(first, last) once for every row, in ascending order: in a grid just before the first body that may
// hit these rows, so that what prepare() writes is still in the cache; for the remaining rows at the end.
using PrepareRows = std::function<void(int first, int last)>;
void cast_rows(const RayCastJob&, int begin, int end, const PrepareRows& prepare) noexcept;

// A pin at a given offset, which rays from every cell of a rectangular layout pass at the same parameters. A
// pin is a column without a bottom; touching its top is not a hit, because a ray may start there.
struct PinStep {
  int row_offset, column_offset;
  float t_enter, t_exit;  // parameters between which the ray is over the pin's rectangle, t_enter ≤ t_exit
};
// The rays of contiguous cells and the pins at one offset from them.
struct PinRowRays {
  const float* start_height;  // of the rays' cells; null: 0 for all
  float origin_z;             // start z of the rays above start_height
  const float* pin_height;    // of the pins
  float* distance;
  float* tag;
  int count;
};
// Records the hits closer than the previous ones. Returns whether there was any.
bool cast_to_pins(const PinRowRays&, const PinStep&, float dz, float range, float tag) noexcept;

}  // namespace smartsurf::surface

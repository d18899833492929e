// The inner loop of the broad phase: which bodies come within reach of one, eight at a time. Written once,
// compiled for each instruction set; every one of them finds the same.
#pragma once

#include <cstdint>
#include <span>

#include "smartsurf/world/parallel/Team.h"

namespace smartsurf::world {

// Spheres within which bodies can touch anything. A vector may read up to kSpare of them past the last.
struct BoundingSpheres {
  const float *x, *y, *z, *radius;
};
inline constexpr int kSimdPadding = 16;

// Writes the places of those in the runs, one run after the other, that meet the one at `self`; how many. Of
// `found` as many as the runs have, and kSpare more, may be written.
int find_overlaps(const BoundingSpheres&, int self, std::span<const IndexRange> runs, std::int32_t* found);

}  // namespace smartsurf::world

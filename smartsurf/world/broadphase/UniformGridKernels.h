// The inner loop of the broad phase: SIMD overlap test of one sphere against runs of spheres.
//
// Compiled for several instruction sets with run-time dispatch; all of them give the same result.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "smartsurf/world/parallel/IndexRange.h"

namespace smartsurf::world {

// Spheres within which bodies can touch anything, u. Arrays must be readable for kSimdPadding elements past
// the last.
struct BoundingSpheres {
  const float *x, *y, *z, *radius;
};
inline constexpr int kSimdPadding = 16;

// By byte: the positions of its set bits, ascending, then zeros.
inline constexpr auto kSetBits = [] {
  std::array<std::array<std::uint8_t, 8>, 256> positions{};
  for (unsigned byte = 0; byte < positions.size(); ++byte)
    for (unsigned bit = 0, count = 0; bit < 8; ++bit)
      if ((byte >> bit & 1U) != 0) positions[byte][count++] = static_cast<std::uint8_t>(bit);
  return positions;
}();

// Writes to `found` the indices of the spheres in the runs that overlap the one at `self`, in ascending
// order within each run, and returns their number. `found` needs space for all spheres in the runs plus
// kSimdPadding.
int find_overlaps(const BoundingSpheres&, int self, std::span<const IndexRange> runs, std::int32_t* found);

}  // namespace smartsurf::world

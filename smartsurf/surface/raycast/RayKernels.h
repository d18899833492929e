// SIMD loops that cast the rays of all cells against bodies and pins. Private to smartsurf/surface/raycast.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <limits>
#include <span>
#include <vector>

#include "smartsurf/surface/raycast/RayBodies.h"

namespace smartsurf::surface {

// Cells of a row that share one dirty flag; one cache line of floats.
inline constexpr int kBlock = 16;

// The rays of a free layout, sorted from south to north into strips of equal height in y, by x within a
// strip.
struct StripLayout {
  float south = 0.0F, height = 1.0F;           // y of the first strip's south edge; height of a strip, u
  std::vector<int> first;                      // strips + 1: the rays of strip s are [first[s], first[s + 1])
  std::vector<float> x, y, dx, dy;             // origin and direction of each ray; dz is the same for all
  std::vector<int> cell;                       // index of the ray's cell in the field
  float max_abs_dx = 0.0F, max_abs_dy = 0.0F;  // maximum |dx| and |dy|
};

struct RayCastJob {
  std::span<const RayBody> bodies;
  std::span<const float> tags;  // one per body
  std::span<const RayBodies::Cluster> clusters;
  // Rays start at z = height + origin.z and extend along the unit vector `direction` for `range`, u.
  Eigen::Vector3f origin, direction;
  float range = 0.0F;
  // Bounds of the start z of all rays; infinite if unknown.
  float min_start_z = -std::numeric_limits<float>::infinity(),
        max_start_z = std::numeric_limits<float>::infinity();
  const float* height = nullptr;  // one per cell; null: 0 for all
  float* distance = nullptr;      // one per cell
  float* tag = nullptr;           // one per cell
  std::uint8_t* dirty_blocks = nullptr;  // one per block; null with strips

  // A rectangular layout, unless `strips` is set.
  int rows = 0, columns = 0, blocks_per_row = 0;
  float pitch = 1.0F;
  const float* x = nullptr;  // x of the ray origins, one per column
  const StripLayout* strips = nullptr;
};

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

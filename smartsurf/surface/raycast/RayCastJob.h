// The targets of a surface's rays, and the destination of the results. Private to
// smartsurf/surface/raycast.
#pragma once

#include <Eigen/Core>
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
  const float* height = nullptr;         // one per cell; null: 0 for all
  float* distance = nullptr;             // one per cell
  float* tag = nullptr;                  // one per cell
  std::uint8_t* dirty_blocks = nullptr;  // one per block; null with strips

  // A rectangular layout, unless `strips` is set.
  int rows = 0, columns = 0, blocks_per_row = 0;
  float pitch = 1.0F;
  const float* x = nullptr;  // x of the ray origins, one per column
  const StripLayout* strips = nullptr;
};

}  // namespace smartsurf::surface

// The number of a step's substeps and their times.
#pragma once

#include <algorithm>

namespace smartsurf::world {

// `iterations`: world.iterations of the scene.
inline int substeps_of(int iterations) { return std::max(1, (iterations + 1) / 2); }

// The mean of the times at which the substeps begin, from the start of the step, s. Impulses act then on
// average.
inline float mean_substep_start(float dt_s, int substeps) {
  return 0.5F * dt_s * static_cast<float>(substeps - 1) / static_cast<float>(substeps);
}

}  // namespace smartsurf::world

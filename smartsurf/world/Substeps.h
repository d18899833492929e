// The times of a step's substeps.
#pragma once

namespace smartsurf::world {

// The mean of the times at which the substeps begin, from the start of the step, s. Impulses act then on
// average.
inline float mean_substep_start(float dt_s, int substeps) {
  return 0.5F * dt_s * static_cast<float>(substeps - 1) / static_cast<float>(substeps);
}

}  // namespace smartsurf::world

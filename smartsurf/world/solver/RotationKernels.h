// How bodies that are no spheres turn freely, eight at a time. Written once, compiled for each instruction
// set; every one of them gives the same bits.
#pragma once

#include "smartsurf/world/solver/SimdLanes.h"

namespace smartsurf::world {

// One lane a body; lanes not in use must hold numbers too. Symmetric matrices: xx, yy, zz, xy, xz, yz.
struct alignas(32) RotationBatch {
  // ---- in
  float orientation[4][kLanes];                          // x, y, z, w: where it is now
  float inertia[6][kLanes], inverse_inertia[6][kLanes];  // in own axes
  float previous_x_axis[3][kLanes];                      // of its axes before
  float is_axisymmetric[kLanes];                         // 1: its axes do not spin about its z; else 0
  // ---- in and out
  float angular_velocity[3][kLanes];  // world axes, rad/s
  // ---- out
  float axes[3][3][kLanes];                // column by column
  float world_inverse_inertia[6][kLanes];  // the inverse inertia in world axes
};

// Lets the gyroscopic effect act for dt_s and brings the axes up to the orientation.
void integrate_gyroscopic(RotationBatch&, float dt_s);

}  // namespace smartsurf::world

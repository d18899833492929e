// Free rotation of non-spheres: gyroscopic torque, axes and world inertia, one body per SIMD lane.
//
// Compiled for several instruction sets with run-time dispatch; all of them give bit-identical results.
#pragma once

#include "smartsurf/world/solver/ContactKernels.h"

namespace smartsurf::world {

// Indexed by component, then lane. Unused lanes must hold valid values too. Symmetric matrices: xx, yy, zz, xy,
// xz, yz.
struct alignas(32) RotationBatch {
  // ---- in
  float orientation[4][kLanes];                          // x, y, z, w
  float inertia[6][kLanes], inverse_inertia[6][kLanes];  // body axes
  float previous_x_axis[3][kLanes];                      // of the axes before the step
  float is_axisymmetric[kLanes];  // 1: the axes do not follow the spin about the body's z axis; 0: they do
  // ---- in and out
  float angular_velocity[3][kLanes];  // world axes, rad/s
  // ---- out
  float axes[3][3][kLanes];  // column, component, lane
  float world_inverse_inertia[6][kLanes];
};

// Applies the gyroscopic torque for dt_s to the angular velocity, without ever adding kinetic energy, and computes
// axes and world_inverse_inertia from the orientation.
void integrate_gyroscopic(RotationBatch&, float dt_s);

}  // namespace smartsurf::world

// Free rotation of non-spheres: orientation, angular velocity, axes and world inertia, one body per SIMD lane.
//
// Compiled for several instruction sets with run-time dispatch; all of them give bit-identical results.
#pragma once

#include "smartsurf/world/solver/ContactKernels.h"

namespace smartsurf::world {

// Indexed by component, then lane. Unused lanes must hold valid values too.
struct alignas(32) RotationBatch {
  // ---- in
  // Directions of the least and the greatest principal moment of inertia, body axes, unit and perpendicular.
  float least_axis[3][kLanes], greatest_axis[3][kLanes];
  float moments[3][kLanes];   // least, middle, greatest; positive
  float rotation[3][kLanes];  // rotation vector of the step as the solver integrated it, world axes, rad
  float free_time[kLanes];    // time to rotate freely for, s
  float previous_x_axis[3][kLanes];  // of the axes before the step
  float is_axisymmetric[kLanes];     // 1: the axes do not follow the spin about the body's z axis; 0: they do
  // ---- in and out
  float orientation[4][kLanes];       // x, y, z, w
  float angular_velocity[3][kLanes];  // world axes, rad/s
  // ---- out
  float axes[3][3][kLanes];                // column, component, lane
  float world_inverse_inertia[6][kLanes];  // symmetric: xx, yy, zz, xy, xz, yz
};

// Rotates the bodies freely for their free_time and then by what `rotation` adds to a constant angular velocity:
// the motion before an impact within the step, and the push-out. The angular momentum stays constant; the new
// angular velocity follows from it and the new orientation. Then computes axes and world_inverse_inertia.
void integrate_rotation(RotationBatch&);

}  // namespace smartsurf::world

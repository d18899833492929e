// Free rotation of non-spheres: orientation, angular velocity, axes and world inertia, one body per SIMD
// lane.
//
// Compiled for several instruction sets with run-time dispatch; all of them give bit-identical results.
#pragma once

#include "smartsurf/world/simd/Lanes.h"

namespace smartsurf::world {

// Indexed by component, then lane. Unused lanes must hold valid values too. In double precision: rounding to
// single precision in each step would change the energy of a tumbling body enough to make it flip at the
// wrong times.
struct alignas(64) RotationBatch {
  // ---- in
  // Directions of the least and the greatest principal moment of inertia, body axes, unit and perpendicular.
  double least_axis[3][kLanes], greatest_axis[3][kLanes];
  double moments[3][kLanes];                  // least, middle, greatest; positive
  double rotation[3][kLanes];                 // rotation vector of the step by the solver, world axes, rad
  double angular_velocity_change[3][kLanes];  // by the solver, world axes, rad/s
  double free_time[kLanes];                   // time to rotate freely for, s
  double previous_x_axis[3][kLanes];          // of the axes before the step
  double is_axisymmetric[kLanes];  // 1: the axes do not follow the spin about the body's z axis; 0: they do
  double slenderness[kLanes];      // PrincipalInertia::slenderness(); 0 with joints
  // ---- in and out
  double orientation[4][kLanes];       // x, y, z, w
  double momentum[3][kLanes];          // angular, world axes
  double angular_velocity[3][kLanes];  // world axes, rad/s; in: as the solver left it
  // ---- out
  double axes[3][3][kLanes];                // column, component, lane
  double world_inverse_inertia[6][kLanes];  // symmetric: xx, yy, zz, xy, xz, yz
};

// Changes the angular momentum by what the solver changed the angular velocity. Rotates the bodies freely for
// their free_time, and then by what `rotation` adds to a constant angular velocity: the motion before an
// impact within the step, and the push-out. Meanwhile the momentum stays constant, but for that along the
// axis of a slender body without joints, which turns with it where contacts act; the new angular velocity
// follows from it and the new orientation. Then computes axes and world_inverse_inertia.
void integrate_rotation(RotationBatch&);

}  // namespace smartsurf::world

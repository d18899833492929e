// The inner loops of the contact solver: over contact batches, with one manifold per SIMD lane and no active
// body in more than one lane of a batch, and over the rows of bodies.
//
// Compiled for several instruction sets with run-time dispatch; all of them give bit-identical results.
#pragma once

#include "smartsurf/world/solver/ContactBatch.h"

namespace smartsurf::world {

// Limit of each component of a velocity, u/s or rad/s; ten times what scripts may set. A body under a huge
// force stays finite and leaves the scene without affecting other bodies.
inline constexpr float kMaxSpeed = 1e7F;

using ContactKernel = void (*)(const ContactBatch* batches, int count, BatchPoints, const SolverBodies&,
                               const SubstepParams&);

// Loops over rows [begin, end) of bodies.
//
// Adds `change` to the velocities and, unless `first`, once more the contacts' change since the last call
// (velocity − start_velocity); start_velocity becomes the velocity without it. Speeds are clamped to
// kMaxSpeed, masses kept.
using IntegrateVelocities = void (*)(int begin, int end, const BodyVelocity& change, bool first,
                                     BodyVelocity* velocity, BodyVelocity* start_velocity);
// Adds the motion of a substep to the delta poses.
using IntegratePositions = void (*)(int begin, int end, float h_s, const BodyVelocity* velocity,
                                    DeltaPose* delta_pose);

// Both loops fused over all substeps, for steps without contacts.
using IntegrateFree = void (*)(int begin, int end, int substeps, float h_s, const BodyVelocity& change,
                               BodyVelocity* velocity, DeltaPose* delta_pose);

struct ContactKernelTable {
  ContactKernel prepare[kContactKindCount];     // effective masses and approach speed
  ContactKernel warm_start[kContactKindCount];  // applies the stored impulses
  ContactKernel solve[kContactKindCount];       // soft constraints: no penetration at the end of the substep
  ContactKernel relax[kContactKindCount];       // removes the velocity that the soft push-out added
  IntegrateVelocities integrate_velocities;
  IntegratePositions integrate_positions;
  IntegrateFree integrate_free;
};

// The kernels for the best instruction set of this machine.
const ContactKernelTable& contact_kernels();

}  // namespace smartsurf::world

// The inner loops of the solver: eight manifolds at a time, one a SIMD lane, none of whose moving bodies is
// in two lanes. Written once, compiled for each instruction set; every one of them gives the same bits.
#pragma once

#include <cstdint>

#include "smartsurf/world/solver/SimdLanes.h"

namespace smartsurf::world {

// ---- one row a body; rows of bodies that never move are not touched
struct alignas(32) BodyVelocity {
  float velocity[3] = {}, inverse_mass = 0;             // u/s
  float angular_velocity[3] = {}, inverse_inertia = 0;  // rad/s; the inertia is a sphere's alone
};
// How far the body has moved and turned since the step began.
struct alignas(32) DeltaPose {
  float translation[3] = {}, unused = 0;
  float rotation[3] = {}, unused_too = 0;
};
// The inverse inertia in world axes.
struct alignas(32) InverseInertia {
  float xx = 0, yy = 0, zz = 0, xy = 0, xz = 0, yz = 0, unused[2] = {};
};
struct SolverBodies {
  BodyVelocity* velocity;
  const DeltaPose* delta_pose;
  const InverseInertia* inverse_inertia;
};

// ---- eight manifolds: lanes 0 … count − 1 are in use, each has `points` points
struct ContactBatch {
  std::int32_t a[kLanes], b[kLanes];
  std::int32_t first_point = 0, point_count = 0, lane_count = 0;  // points[first … first + points)
  bool has_rolling_friction = false;                              // whether any lane resists rolling
  bool has_impulse_limit = false;                                 // whether any point has a limit
};

// The k-th point of each of the eight. A lane without one has a zero normal and a wide gap.
// What every pass over round pairs reads comes first and alone: the passes are bound by memory.
struct alignas(64) BatchPoint {
  float normal[3][kLanes];
  float radius_a[kLanes], radius_b[kLanes];  // of spheres
  float normal_impulse[kLanes], friction_impulse[3][kLanes], total_normal_impulse[kLanes];
  float separation[kLanes];
  // The lowest relative speed along the normal that the relaxing pass allows; then the rebound's impulse.
  float relax_target_speed[kLanes];
  float normal_mass[kLanes], tangent_mass[kLanes], friction[kLanes];
  float approach_speed[kLanes];  // the relative speed along the normal as the step began
};
struct alignas(64) BatchPointDetail {
  float anchor_a[3][kLanes], anchor_b[3][kLanes];
  float surface_velocity[3][kLanes], surface_spin[kLanes];
  float rolling_friction[kLanes], rolling_mass[kLanes], rolling_impulse[3][kLanes];
  float restitution[kLanes];
  float max_normal_impulse[kLanes];   // of octets with `limited`: the greatest push of a step
  float slip_per_impulse[3][kLanes];  // of a's surface over b's that a unit push brings; of any shapes
};
struct BatchPoints {
  BatchPoint* point;
  BatchPointDetail* detail;
};

struct SubstepParams {
  float h_s, inverse_h;
  float elapsed_s;                             // since the step began
  float bias_rate, mass_scale, impulse_scale;  // the softness of the push that ends an overlap
  float max_bias_velocity;                     // u/s
  float restitution_threshold;                 // u/s
  float substep_fraction = 1.0F;               // of the substep in the step
};

// Which of the four kinds an octet is of: against another body or the world; spheres only or any shapes.
enum ContactKind { kSpherePair, kGeneralPair, kSphereStatic, kGeneralStatic, kContactKindCount };

using ContactKernel = void (*)(const ContactBatch* octets, int count, BatchPoints, const SolverBodies&,
                               const SubstepParams&);

struct ContactKernelTable {
  ContactKernel prepare[kContactKindCount];     // effective masses and the speed of approach
  ContactKernel warm_start[kContactKindCount];  // applies the impulses that each point brings along
  ContactKernel solve[kContactKindCount];       // towards no overlap at the end of the substep
  ContactKernel relax[kContactKindCount];       // takes out the speed that the push out of an overlap left
  ContactKernel apply_restitution[kContactKindCount];  // Newton's rule, at the end of the step
};

// For this machine's instruction set.
const ContactKernelTable& contact_kernels();

}  // namespace smartsurf::world

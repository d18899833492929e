// The inner loops of the solver: eight manifolds at a time, one a SIMD lane, none of whose moving bodies is
// in two lanes. Written once, compiled for each instruction set; every one of them gives the same bits.
#pragma once

#include <cstdint>

#include "smartsurf/world/Lanes.h"

namespace smartsurf::world {

// ---- one row a body; rows of bodies that never move are not touched
struct alignas(32) Motion {
  float velocity[3] = {}, inverse_mass = 0;  // u/s
  float spin[3] = {}, inverse_inertia = 0;   // rad/s; the inertia is a sphere's alone
};
// How far the body has moved and turned since the step began.
struct alignas(32) Shift {
  float by[3] = {}, unused = 0;
  float turn[3] = {}, unused_too = 0;
};
// The inverse inertia in world axes.
struct alignas(32) Inertia {
  float xx = 0, yy = 0, zz = 0, xy = 0, xz = 0, yz = 0, unused[2] = {};
};
struct BodyRows {
  Motion* motion;
  const Shift* shift;
  const Inertia* inertia;
};

// ---- eight manifolds: lanes 0 … count − 1 are in use, each has `points` points
struct Octet {
  std::int32_t a[kLanes], b[kLanes];
  std::int32_t first = 0, points = 0, count = 0;  // points[first … first + points)
  bool rolls = false;                             // whether any lane resists rolling
  bool limited = false;                           // whether any point has a limit
};

// The k-th point of each of the eight. A lane without one has a zero normal and a wide gap.
// What every pass over round pairs reads comes first and alone: the passes are bound by memory.
struct alignas(64) Point {
  float normal[3][kLanes];
  float radius_a[kLanes], radius_b[kLanes];  // of spheres
  float push[kLanes], drag[3][kLanes], total[kLanes];
  float gap[kLanes];
  // The lowest relative speed along the normal that the relaxing pass allows; then the rebound's impulse.
  float slowest[kLanes];
  float normal_mass[kLanes], tangent_mass[kLanes], friction[kLanes];
  float approach[kLanes];  // the relative speed along the normal as the step began
};
struct alignas(64) PointDetail {
  float arm_a[3][kLanes], arm_b[3][kLanes];
  float surface[3][kLanes], surface_spin[kLanes];
  float rolling[kLanes], rolling_mass[kLanes], roll[3][kLanes];
  float restitution[kLanes];
  float limit[kLanes];    // of octets with `limited`: the greatest push of a step
  float slip[3][kLanes];  // of a's surface over b's that a unit push brings; of any shapes
};
struct Points {
  Point* point;
  PointDetail* detail;
};

struct Pass {
  float h_s, inverse_h;
  float elapsed_s;                        // since the step began
  float rate, mass_scale, impulse_scale;  // the softness of the push that ends an overlap
  float fastest_push;                     // u/s
  float bounce_threshold;                 // u/s
  float share = 1.0F;                     // of the substep in the step
};

// Which of the four kinds an octet is of: against another body or the world; spheres only or any shapes.
enum ContactKind { kRoundPair, kAnyPair, kRoundWorld, kAnyWorld, kContactKinds };

using Kernel = void (*)(const Octet* octets, int count, Points, const BodyRows&, const Pass&);

struct KernelTable {
  Kernel prepare[kContactKinds];  // effective masses and the speed of approach
  Kernel warm[kContactKinds];     // applies the impulses that each point brings along
  Kernel solve[kContactKinds];    // towards no overlap at the end of the substep
  Kernel relax[kContactKinds];    // takes out the speed that the push out of an overlap left
  Kernel rebound[kContactKinds];  // Newton's rule, at the end of the step
};

// For this machine's instruction set.
const KernelTable& contact_kernels();

}  // namespace smartsurf::world

// Flat faces on elastic tops: each cell of the patch is a spring of its own.
//
// A top has the stiffness k and the damping c; the part of it that the face covers has that part of both, a
// quarter at each of its corners. A corner stays at its place on the face, so that its load is the gradient
// of the energy in its spring: a face that rocks on its tops gains none. With the depth d of the face in the
// top at a corner of k and c, its rate u before the substep h and u' after it, the corner bears
//   J = max(0, h·(k·(d + h·(α·u' − β·u)) + c·u'))
// With α = β = 1/4 this is the trapezoidal rule of the load on its springs, which adds no damping. A load
// that swings faster than the substeps can follow is damped: κ = h²·Σk/m is that of the body on its springs,
// w = κ²/(1 + κ²), α = (1 + 3w)/4 and β = (1 − w)/4. With n substeps in a period the logarithmic decrement
// is about π·(2π/n)⁵.
// A top that the face reaches within the substep takes up the implicit load of the depth there, and the relax
// stage begins from that depth at rest.
//
// The velocity of the face has three unknowns, v = a + b·x + c·y. They fulfil the body's momentum with the
// loads J(v), the gradient of a convex, piecewise quadratic function: Newton's method with an exact line
// search finds them in few steps, whatever the stiffness.
#pragma once

#include <span>
#include <vector>

#include "smartsurf/world/field/SupportPatch.h"
#include "smartsurf/world/solver/ContactBatch.h"
#include "smartsurf/world/solver/SupportPoints.h"

namespace smartsurf::world {

// The velocity of the face at (x, y) as a + b·x + c·y.
inline support::Vector3 motion_of(const BodyVelocity& m) {
  return Vec3(m.velocity[2], -m.angular_velocity[1], m.angular_velocity[0]).cast<double>();
}

// The load of one corner as max(0, at_rest − per_speed·v), with the velocity v of the face there.
struct LinearLoad {
  support::Vector3 at;  // 1, x, y
  double at_rest = 0.0, per_speed = 0.0;
  double at_velocity(const support::Vector3& motion) const { return at_rest - per_speed * at.dot(motion); }
};

// Preconditions of the following: the patch is elastic.

// Before the external forces of the first substep. The loads of the last step warm-start this one.
void prepare_springs(SupportPatches&, SupportPatch&, const BodyVelocity&, float substep_fraction);
void warm_start_springs(const SupportPatch&, BodyVelocity&, const InverseInertia&);
// Solves the loads of all cells of the patch at once.
void solve_springs(SupportPatches&, SupportPatch&, const SubstepParams&, bool is_soft, BodyVelocity&,
                   const DeltaPose&, const InverseInertia&);
// For the direct solver, after solve_springs(): appends the loads of all corners, and later takes those at
// `motion` for them. Does not change the body's velocity.
void append_loads(const SupportPatches&, const SupportPatch&, float h_s, bool is_soft,
                  std::vector<LinearLoad>&);
void take_loads(SupportPatches&, SupportPatch&, std::span<const LinearLoad>, const support::Vector3& motion);
// At the end of the solve stage or of the relax stage.
void end_spring_stage(SupportPatches&, SupportPatch&, bool is_soft, const BodyVelocity&);
// Before the stage ends again, with other loads.
void take_back_spring_stage(SupportPatches&, const SupportPatch&, bool is_soft);

}  // namespace smartsurf::world

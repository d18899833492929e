// Solves the support patches: distributes the normal impulses of a patch's points over its samples, and
// solves the Coulomb friction of the samples.
//
// A patch has three degrees of freedom: q = the velocity of the underside along x and y, below the centre of
// mass, and the angular velocity about z. `response` is the symmetric matrix K of q per friction impulse
// (entries xx, yy, zz, xy, xz, yz; x, y: force, z: torque). A solve finds the q for which q = q₀ + K·Σ fᵢ(q),
// where fᵢ(q) is the impulse of the last solve minus a multiple of the slip, clamped to the sample's cone (a
// proximal step). Few iterations of a majorised Newton method suffice, because the solution changes little
// from stage to stage.
//
// On cells at rest, a patch that its cells can hold has q = 0, whichever way they share the friction; on
// cells that move as one belt it has the belt's velocity. That is lumped: one impulse, which is shared among
// the samples when the patch begins to slip.
#pragma once

#include <span>

#include "smartsurf/world/contact/Contact.h"
#include "smartsurf/world/field/SupportPatch.h"
#include "smartsurf/world/solver/ContactBatch.h"

namespace smartsurf::world {

// Sets the derived members of a patch, of a body with this velocity row. `contacts`: of the body's manifold;
// `substep_fraction`: as in SubstepParams.
void prepare_support(SupportPatches&, SupportPatch&, const BodyVelocity&, const InverseInertia&,
                     float friction, float substep_fraction, std::span<const Contact> contacts);
// Applies the friction impulses of the last step.
void warm_start_support(const SupportPatch&, BodyVelocity&, const InverseInertia&);
// Friction within the cones of the normal impulses at the patch's points. The soft impulses of the solve
// stage are provisional: they are distributed as those of the last relax stage.
void solve_support(SupportPatches&, SupportPatch&, BatchPoints, bool is_soft, BodyVelocity&,
                   const InverseInertia&);
// Gives the load of each cell to its points, at the end of the relax stage, if there are force limits.
void share_loads(SupportPatches&, SupportPatch&, BatchPoints);
// Stores the loads over the step at its end, and shares the friction impulse among the contacts, where it
// warm-starts the next step if the patch is gone by then.
void store_support(SupportPatches&, SupportPatch&, std::span<Contact> contacts);

}  // namespace smartsurf::world

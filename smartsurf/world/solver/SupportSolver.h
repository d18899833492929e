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
#include "smartsurf/world/solver/SupportKernels.h"

namespace smartsurf::world {

inline constexpr std::uint32_t kAllLanes = (1U << static_cast<unsigned>(kLanes)) - 1U;

// The support patches of the bodies in one batch of static contacts.
struct SupportBatch {
  SupportPatches* list[kLanes] = {};
  SupportPatch* patch[kLanes] = {};     // null: the lane has none
  std::span<Contact> contacts[kLanes];  // of the body with what is static
  // True if the points of any patch are solved with those of the others, or by themselves, or its wrench is
  // found by itself.
  bool any_in_lanes = false, any_alone = false, any_wrench_alone = false;
  SupportLanes lanes;
  SupportFriction friction;

  // Calls each(list, patch, lane) for the patches.
  template <class Each>
  void for_each(Each each) {
    for (int lane = 0; lane < kLanes; ++lane)
      if (patch[lane] != nullptr) each(*list[lane], *patch[lane], lane);
  }
};

// Sets the derived members of the patch in a lane, of a body with this velocity row. `substep_fraction`: as
// in SubstepParams.
void prepare_support(SupportBatch&, int lane, const BodyVelocity&, const InverseInertia&, float friction,
                     float substep_fraction);
// Shares the friction impulse of the patch among its samples.
void spread_friction(SupportSamples&, SupportPatch&);
// Applies the friction impulses of the last step.
void warm_start_support(const SupportPatch&, BodyVelocity&, const InverseInertia&);
// Finds the friction of the patches in a set of lanes, within the cones of the normal impulses at their
// points. The soft impulses of the solve stage are provisional: they are distributed as those of the last
// relax stage.
void solve_supports(SupportBatch&, std::uint32_t lanes, BatchPoints, bool is_soft, BodyVelocity*,
                    const InverseInertia*);
// Adds a patch of another batch in the next lane, after prepare_support(). With it in a batch of its own,
// solve_supports() touches nothing of the other patches of the first batch. The views of the samples must be
// copied from the one batch to the other where these take turns.
void add_support(const SupportBatch& from, int from_lane, SupportBatch& to, int lane);
// Solves friction, and the points of the patches before it and, unless `is_soft`, after it: friction tilts a
// body, and the normal constraints must hold at the end of the step. No patch of the batch is alone.
void solve_points_and_friction(SupportBatch&, BatchPoints, const SubstepParams&, bool is_soft, BodyVelocity*,
                               const DeltaPose*, const InverseInertia*);
// Gives the load of each cell to its points, at the end of the relax stage, if there are force limits.
void share_loads(SupportPatches&, SupportPatch&, BatchPoints);
// Stores the loads over the step at its end, once. The coming steps depend on those of some patches only, of
// which finds_loads_when_asked() is false.
void store_loads(SupportPatches&, SupportPatch&, std::span<const Contact>);
inline bool finds_loads_when_asked(const SupportPatch& p) { return !p.is_elastic && !p.has_shares; }
// Shares the friction impulse at the end of the step among the contacts, where it warm-starts the next step
// if the patch is gone by then.
void store_friction(const SupportPatches&, const SupportPatch&, std::span<Contact>);

}  // namespace smartsurf::world

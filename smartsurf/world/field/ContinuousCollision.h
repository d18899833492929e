// Continuous collision of fast bodies with the field.
//
// The solver keeps normals and anchors constant within a step. That fails for a small non-sphere that moves
// by many times its own size per step: the impact spins it, and a corner swings through a column within the
// same step. Such a body is swept along its motion and stopped at the time of impact; the contacts of the
// next step then remove its velocity. Spheres need none of this, because their rotation does not change
// their shape.
#pragma once

#include "smartsurf/world/body/BodyStore.h"
#include "smartsurf/world/field/FieldCollider.h"

namespace smartsurf::world {

// The part of a body's motion in the step after which it would penetrate the field deeper than at the start
// of the step, or than a small tolerance; 1 if it does not. Returns at once for spheres and for bodies that
// move by less than a quarter of their width. May run concurrently.
float fraction_until_impact(const FieldCollider&, const BodyStore&, std::size_t body,
                            const DeltaPose& motion);
// Scales BodyStore::delta_pose of the body down by that; returns whether it had to. May run concurrently for
// different bodies.
bool clip_to_time_of_impact(const FieldCollider&, BodyStore&, std::size_t body);

}  // namespace smartsurf::world

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

// Scales BodyStore::delta_pose of the body down so that the body penetrates the field no deeper than at the
// start of the step, or a small tolerance; returns whether it had to. Returns at once for spheres and for
// bodies that move by less than a quarter of their width. May run concurrently for different bodies.
bool clip_to_time_of_impact(const FieldCollider&, BodyStore&, std::size_t body);

}  // namespace smartsurf::world

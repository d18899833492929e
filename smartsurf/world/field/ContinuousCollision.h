// Stops fast bodies at the field.
//
// The solver takes normals and arms for constant through a step. For a small body that comes in turned, at
// many times its own size a step, they are not: it is thrown into a spin and swings a corner through a column
// within the step that stops it. Such a body is followed along its way, and the step ends for it where it
// would dip in; the contacts of the next step then take its speed. Spheres have nothing that could swing.
#pragma once

#include "smartsurf/world/BodyStore.h"
#include "smartsurf/world/CollisionPipeline.h"

namespace smartsurf::world {

// Shortens BodyStore::shift. Costs nothing for a body that moves by less than a quarter of its width.
void clip_to_time_of_impact(const CollisionPipeline&, BodyStore&, std::size_t body);

}  // namespace smartsurf::world

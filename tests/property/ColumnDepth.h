// How deep objects are in cells: the least translation that separates them, from poses and cells alone.
#pragma once

#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/scene/Snapshot.h"
#include "smartsurf/surface/Field.h"

namespace physics_fixture {

// The greatest depth of the object in any cell, u: the least length of a translation, not downwards, that
// takes one of its convex parts out of the cell. A cell is a bottomless column: with a rectangular top, also
// turned, or with the tip of a pin. `index`: of the object in the snapshot.
double depth_in_columns(const smartsurf::surface::Field&, const smartsurf::scene::ObjectSpec&,
                        const smartsurf::scene::Snapshot&, std::size_t index);

}  // namespace physics_fixture

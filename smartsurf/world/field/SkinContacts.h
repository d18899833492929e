// Contacts of a body with a sheet over the cells (surface::Skin), which is a surface of triangles.
#pragma once

#include <vector>

#include "smartsurf/surface/Skin.h"
#include "smartsurf/world/Contact.h"
#include "smartsurf/world/narrowphase/Shape.h"

namespace smartsurf::world {

// Appends the contacts with separations up to `margin` ≥ 0: points of the sheet that are nearest to the body among those
// around them, so that nothing catches on the edges between triangles of one plane. A sphere has at most four
// (SphereManifoldReducer), each convex part of another body up to eight (ManifoldReducer): its corners and edges over the
// triangles that face them, and nodes of the sheet under it. Edges of the sheet that cross an edge of the body between two
// nodes are not found. The sheet has no lower side: what is less than its own size below is above it.
// Cost: proportional to the triangles under the body.
void collide_with_skin(const surface::Skin&, const Shape&, const Vec3& centre, const Mat3& axes, float margin,
                       std::vector<Contact>& out);

}  // namespace smartsurf::world

// Contacts of a body with a skin over the cells (surface::Skin), which is a surface of triangles.
#pragma once

#include <vector>

#include "smartsurf/surface/Skin.h"
#include "smartsurf/world/body/Shape.h"
#include "smartsurf/world/contact/Contact.h"

namespace smartsurf::world {

// Appends the contacts with separations up to `margin` ≥ 0: the points of the skin that are nearest to the
// body among their neighbours, so that nothing catches on the edges between triangles of one plane. A sphere
// has at most four (SphereManifoldReducer). Each convex part of another body touches a kinematic skin in up
// to eight (ManifoldReducer) of its corners, points of its rims, and nodes of the skin under it. An elastic
// skin has more: the outermost corners and points of rims in 26 directions, and in any body about 36 nodes.
// An edge of the skin that crosses an edge of the body between two nodes is not found. The skin has no lower
// side: a point that is below it by less than the body's own diameter is pushed up. The cost is proportional
// to the number of nodes under the body and to that of its corners.
void collide_with_skin(const surface::Skin&, const Shape&, const Vec3& centre, const Mat3& axes, float margin,
                       std::vector<Contact>& out);

}  // namespace smartsurf::world

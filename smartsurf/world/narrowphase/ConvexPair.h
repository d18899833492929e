// Where two convex shapes, neither a sphere, touch.
#pragma once

#include <vector>

#include "smartsurf/world/Contact.h"
#include "smartsurf/world/narrowphase/Gjk.h"
#include "smartsurf/world/narrowphase/Shape.h"

namespace smartsurf::world {

struct PlacedShape {
  const Shape& shape;
  const Vec3& centre;
  const Mat3& axes;
};

// Appends up to four points for each pair of pieces, the normal pointing from b to a, gaps up to `margin`.
// `last_normal`: of a contact that the two had before, or null; `last`: what of the two was nearest then,
// which is brought up to date, or null. They save work and decide nothing.
// Returns how far apart all pieces are at least that were given no point, told up to `horizon` beyond the
// margin; the margin where each was given one.
float collide_convex(const PlacedShape& a, const PlacedShape& b, float margin, const Vec3* cached_normal,
                     std::vector<Contact>& out, float horizon = 0.0F, SimplexCache* simplex_cache = nullptr);

}  // namespace smartsurf::world

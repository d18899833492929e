// Contact manifolds of two convex shapes, neither a sphere.
#pragma once

#include <vector>

#include "smartsurf/world/body/Shape.h"
#include "smartsurf/world/contact/Contact.h"
#include "smartsurf/world/narrowphase/Gjk.h"

namespace smartsurf::world {

struct PlacedShape {
  const Shape& shape;
  const Vec3& centre;
  const Mat3& axes;
};

// A box that is much larger than the other body is trimmed to a window around it, because GJK loses precision
// on long, thin simplices.
struct TrimmedBox {
  Shape shape;
  Vec3 centre;
  bool overlaps;  // the window
};
bool is_much_larger(const PlacedShape& box, const PlacedShape& other);
TrimmedBox trim(const PlacedShape& box, const Vec3& around, float half_width);

// Appends up to eight contacts per pair of parts (ManifoldReducer), with separations up to `margin` and
// normals from b to a. `cached_normal`: normal of a previous contact, or null; `simplex_cache`: read and
// updated, or null. Both affect speed only. Returns a lower bound of the separation of all pairs of parts
// without contact, at most margin + horizon; `margin` if every pair has one.
float collide_convex(const PlacedShape& a, const PlacedShape& b, float margin, const Vec3* cached_normal,
                     std::vector<Contact>& out, float horizon = 0.0F, SimplexCache* simplex_cache = nullptr);

}  // namespace smartsurf::world

// The signed distance from a point to a convex shape, in body axes.
#pragma once

#include <limits>

#include "smartsurf/world/body/Shape.h"

namespace smartsurf::world {

// One convex part of a shape: the shape itself, or a hull of a solid.
struct ConvexPart {
  const Shape& shape;
  const ConvexHullShape* hull = nullptr;  // null unless the shape is a solid
};

template <class Work>
void for_each_part(const Shape& shape, Work visit) {
  if (shape.hulls.empty()) return visit(ConvexPart{shape, nullptr});
  for (const ConvexHullShape& hull : shape.hulls) visit(ConvexPart{shape, &hull});
}

struct SignedDistance {
  Vec3 normal;     // unit, outward at the nearest surface point
  float distance;  // u; negative inside
};
// If the distance exceeds `limit`, the result is some value greater than `limit`.
SignedDistance signed_distance(const ConvexPart&, const Vec3& point,
                               float limit = std::numeric_limits<float>::max());

}  // namespace smartsurf::world

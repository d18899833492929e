// The signed distance from a point to a convex shape, in the shape's own axes, and the way out.
#pragma once

#include <limits>

#include "smartsurf/world/Shape.h"

namespace smartsurf::world {

// One convex part of a shape: the shape itself, or a piece of a solid.
struct Piece {
  const Shape& shape;
  const HullPiece* hull = nullptr;  // of a solid
};

template <class Work>
void for_pieces(const Shape& shape, Work work) {
  if (shape.hulls.empty()) return work(Piece{shape, nullptr});
  for (const HullPiece& hull : shape.hulls) work(Piece{shape, &hull});
}

struct Outward {
  Vec3 normal;     // unit
  float distance;  // below 0 inside
};
// Of a point farther away than `limit` only that it is.
Outward outward_of(const Piece&, const Vec3& point, float limit = std::numeric_limits<float>::max());

}  // namespace smartsurf::world

// The points of a convex piece that can be the first to touch a plane.
#pragma once

#include "smartsurf/world/narrowphase/Distance.h"

namespace smartsurf::world {

// Calls each(point) for the points up to `highest` that touch a plane first: corners, the tip, and eight
// points of each rim, one of them the lowest. A capsule has none.
template <class Each>
void for_each_feature_point(const ConvexPart& piece, const Vec3& centre, const Mat3& axes, float highest,
                            Each each) {
  using scene::ShapeKind;
  constexpr int kRim = 8;
  const Shape& s = piece.shape;
  const Vec3 up = axes.row(2);
  auto own = [&](const Vec3& p) {
    if (centre.z() + up.dot(p) <= highest) each(Vec3(centre + axes * p));
  };
  auto rim = [&](float z) {
    Vec3 lowest(-axes(2, 0), -axes(2, 1), 0);
    lowest = lowest.squaredNorm() > 1e-10F ? Vec3(lowest.normalized()) : Vec3(1, 0, 0);
    constexpr float kDiagonal = 0.70710678F;
    static constexpr float kAlong[kRim] = {1, kDiagonal, 0, -kDiagonal, -1, -kDiagonal, 0, kDiagonal};
    for (int i = 0; i < kRim; ++i) {
      const float u = kAlong[i] * s.radius, v = kAlong[(i + 6) % kRim] * s.radius;
      own({lowest.x() * u - lowest.y() * v, lowest.y() * u + lowest.x() * v, z});
    }
  };
  switch (s.kind) {
    case ShapeKind::kSphere:
    case ShapeKind::kCapsule:
      break;
    case ShapeKind::kBox:
      for (int i = 0; i < 8; ++i)
        own(s.half_extents.cwiseProduct(
            Vec3(i & 1 ? 1.0F : -1.0F, i & 2 ? 1.0F : -1.0F, i & 4 ? 1.0F : -1.0F)));
      break;
    case ShapeKind::kCylinder:
      rim(s.low);
      rim(s.high);
      break;
    case ShapeKind::kCone:
      rim(s.low);
      own({0, 0, s.high});
      break;
    case ShapeKind::kSolid:
      for (const Vec3& corner : piece.hull->hull->vertices) own(corner);
      break;
  }
}

}  // namespace smartsurf::world

// The points of a convex part that can touch a horizontal plane first.
#pragma once

#include "smartsurf/world/narrowphase/Distance.h"

namespace smartsurf::world {

// Points that sample a circular rim, the first one in the direction that is asked for.
inline constexpr int kRimPoints = 8;

// Calls each(point) for the points with z ≤ max_z, world frame: corners, a cone's tip, and eight points per
// rim, one of them the lowest. Spheres and capsules have none.
template <class Each>
void for_each_feature_point(const ConvexPart& part, const Vec3& centre, const Mat3& axes, float max_z,
                            Each each) {
  using scene::ShapeKind;
  const Shape& s = part.shape;
  const Vec3 up = axes.row(2);
  auto visit_local = [&](const Vec3& p) {
    if (centre.z() + up.dot(p) <= max_z) each(Vec3(centre + axes * p));
  };
  auto visit_rim = [&](float z) {
    Vec3 lowest(-axes(2, 0), -axes(2, 1), 0);
    lowest = lowest.squaredNorm() > 1e-10F ? Vec3(lowest.normalized()) : Vec3(1, 0, 0);
    constexpr float kDiagonal = 0.70710678F;
    static constexpr float kCosine[kRimPoints] = {1, kDiagonal, 0, -kDiagonal, -1, -kDiagonal, 0, kDiagonal};
    for (int i = 0; i < kRimPoints; ++i) {
      const float u = kCosine[i] * s.radius, v = kCosine[(i + 6) % kRimPoints] * s.radius;
      visit_local({lowest.x() * u - lowest.y() * v, lowest.y() * u + lowest.x() * v, z});
    }
  };
  switch (s.kind) {
    case ShapeKind::kSphere:
    case ShapeKind::kCapsule:
      break;
    case ShapeKind::kBox:
      for (int i = 0; i < 8; ++i)
        visit_local(s.half_extents.cwiseProduct(
            Vec3(i & 1 ? 1.0F : -1.0F, i & 2 ? 1.0F : -1.0F, i & 4 ? 1.0F : -1.0F)));
      break;
    case ShapeKind::kCylinder:
      visit_rim(s.low);
      visit_rim(s.high);
      break;
    case ShapeKind::kCone:
      visit_rim(s.low);
      visit_local({0, 0, s.high});
      break;
    case ShapeKind::kSolid:
      for (const Vec3& corner : part.hull->hull->vertices) visit_local(corner);
      break;
  }
}

}  // namespace smartsurf::world

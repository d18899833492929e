// The nearest points of two convex cores (Gilbert, Johnson and Keerthi 1988).
#pragma once

#include "smartsurf/world/narrowphase/Distance.h"

namespace smartsurf::world {

// A convex piece where it stands. Its core is the piece drawn in by `rounding`: shapes that overlap a little
// have cores that do not.
struct ConvexProxy {
  ConvexPart part;
  const Vec3& centre;
  const Mat3& axes;
  float convex_radius;

  ConvexProxy(const ConvexPart& p, const Vec3& position, const Mat3& orientation)
      : part(p),
        centre(position),
        axes(orientation),
        convex_radius(p.hull ? p.hull->convex_radius : p.shape.convex_radius) {}
  // The core's farthest point along a direction, world frame.
  Vec3 support(const Vec3& direction) const;
  // The same of the whole piece.
  Vec3 support_with_radius(const Vec3& unit_direction) const {
    return support(unit_direction) + convex_radius * unit_direction;
  }
};

struct ClosestPoints {
  Vec3 on_a, on_b;
  Vec3 normal;     // unit, from b to a
  float distance;  // between the cores
  bool separated;  // false: the cores overlap, and nothing else is known
};
// What of the two was nearest, in the axes of each. It saves work where they have hardly moved since, and
// decides nothing.
struct SimplexCache {
  int count = 0;  // 1: two corners, 2 or 3: an edge or a face takes part; 0: not known
  Vec3 on_a[3], on_b[3];
};
// When the cores are further apart than `limit`, a distance beyond it is all that is told. `towards_a`: a
// guess at the direction from b to a, of any length. `last`: taken for a start and brought up to date, or
// null.
ClosestPoints closest_points(const ConvexProxy& a, const ConvexProxy& b, float limit, const Vec3& towards_a,
                             SimplexCache* cache = nullptr);

}  // namespace smartsurf::world

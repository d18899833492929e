// The nearest points of two convex cores (Gilbert, Johnson and Keerthi 1988).
#pragma once

#include "smartsurf/world/Distance.h"

namespace smartsurf::world {

// A convex piece where it stands. Its core is the piece drawn in by `rounding`: shapes that overlap a little
// have cores that do not.
struct Core {
  Piece piece;
  const Vec3& centre;
  const Mat3& axes;
  float rounding;

  Core(const Piece& p, const Vec3& at, const Mat3& turned)
      : piece(p), centre(at), axes(turned), rounding(p.hull ? p.hull->rounding : p.shape.rounding) {}
  // The core's farthest point along a direction, world frame.
  Vec3 farthest(const Vec3& direction) const;
  // The same of the whole piece.
  Vec3 farthest_outside(const Vec3& unit) const { return farthest(unit) + rounding * unit; }
};

struct NearestPoints {
  Vec3 on_a, on_b;
  Vec3 normal;     // unit, from b to a
  float distance;  // between the cores
  bool apart;      // false: the cores overlap, and nothing else is known
};
// What of the two was nearest, in the axes of each. It saves work where they have hardly moved since, and
// decides nothing.
struct NearestFeature {
  int count = 0;  // 1: two corners, 2 or 3: an edge or a face takes part; 0: not known
  Vec3 on_a[3], on_b[3];
};
// When the cores are further apart than `limit`, a distance beyond it is all that is told. `towards_a`: a
// guess at the direction from b to a, of any length. `last`: taken for a start and brought up to date, or
// null.
NearestPoints nearest_points(const Core& a, const Core& b, float limit, const Vec3& towards_a,
                             NearestFeature* last = nullptr);

}  // namespace smartsurf::world

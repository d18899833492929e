// Closest points of two convex shapes (Gilbert, Johnson and Keerthi 1988).
#pragma once

#include "smartsurf/world/narrowphase/Distance.h"

namespace smartsurf::world {

// A convex part at a pose, represented by its core, the part shrunk by convex_radius: parts that overlap by
// less than their radii have disjoint cores, for which GJK gives a normal.
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
  // Support point of the core along a direction of any length, world frame.
  Vec3 support(const Vec3& direction) const;
  // Support point of the whole part; the direction is a unit vector.
  Vec3 support_with_radius(const Vec3& unit_direction) const {
    return support(unit_direction) + convex_radius * unit_direction;
  }
  // Support point of the part with its sharp edges, which the core plus convex_radius rounds off.
  Vec3 sharp_support(const Vec3& unit_direction) const;
};

struct ClosestPoints {
  Vec3 on_a, on_b;
  Vec3 normal;     // unit, from b to a
  float distance;  // between the cores
  bool separated;  // false: the cores overlap, and the other members are undefined
};
// The final simplex of a query, in body axes, as a starting point for the next one. Affects speed only.
struct SimplexCache {
  int count = 0;  // vertices of the simplex; 0: empty
  // Entries from `count` on are zero, because saved states include them.
  Vec3 on_a[3]{Vec3::Zero(), Vec3::Zero(), Vec3::Zero()}, on_b[3]{Vec3::Zero(), Vec3::Zero(), Vec3::Zero()};
};
// If the cores are farther apart than `limit`, only the distance is set, to some value beyond it.
// `towards_a`: estimate of the direction from b to a, of any length. `cache`: read and updated; may be null.
// Where the search does not converge, `distance` is a lower bound along the normal.
ClosestPoints closest_points(const ConvexProxy& a, const ConvexProxy& b, float limit, const Vec3& towards_a,
                             SimplexCache* cache = nullptr);

}  // namespace smartsurf::world

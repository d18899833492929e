// Intersects vertical lines with objects, for actuators that act on the objects covering their cells.
#pragma once

#include <Eigen/Geometry>
#include <limits>

#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::surface {

// The z interval of the line inside the object, u, relative to the origin. Empty if low > high.
struct VerticalIntersection {
  float low = std::numeric_limits<float>::infinity();
  float high = -std::numeric_limits<float>::infinity();
};

// An object at one orientation, prepared for many lines. Holds a reference to the object.
class VerticalIntersector {
 public:
  VerticalIntersector(const scene::ObjectSpec&, const Eigen::Quaternionf& orientation);

  // Intersects the vertical line at horizontal offset (dx, dy) from the origin. The result for a
  // solid of several convex hulls spans from the lowest to the highest point.
  VerticalIntersection intersect(float dx, float dy) const;
  // Half extent of the object about its origin, u: the larger of x and y.
  float horizontal_reach() const { return horizontal_reach_; }

 private:
  VerticalIntersection intersect_solid(const Eigen::Vector3f& origin, const Eigen::Vector3f& up) const;

  const scene::ObjectSpec& object_;
  Eigen::Matrix3f to_local_;
  Eigen::Vector3f half_extents_;
  float horizontal_reach_;
};

}  // namespace smartsurf::surface

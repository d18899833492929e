// Where a vertical line crosses an object: for actuators that act on what covers their cells.
#pragma once

#include <Eigen/Geometry>
#include <limits>

#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::surface {

// z, relative to the object's centre of mass, where the line enters and leaves; nothing where low > high.
struct VerticalIntersection {
  float low = std::numeric_limits<float>::infinity();
  float high = -std::numeric_limits<float>::infinity();
};

// One object in its place, prepared for many lines. Keeps a reference to the object.
class VerticalIntersector {
 public:
  VerticalIntersector(const scene::ObjectSpec&, const Eigen::Quaternionf& orientation);

  // The line that passes the centre of mass at (dx, dy). Of a solid in several pieces: from its lowest to its
  // highest point.
  VerticalIntersection intersect(float dx, float dy) const;
  // How far the object reaches from its centre of mass along x and y.
  float horizontal_reach() const { return horizontal_reach_; }

 private:
  VerticalIntersection intersect_solid(const Eigen::Vector3f& origin, const Eigen::Vector3f& up) const;

  const scene::ObjectSpec& object_;
  Eigen::Matrix3f to_local_;
  Eigen::Vector3f half_extents_;
  float horizontal_reach_;
};

}  // namespace smartsurf::surface

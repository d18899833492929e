#include "smartsurf/surface/actuators/VerticalIntersection.h"

#include <algorithm>
#include <cmath>

namespace smartsurf::surface {
namespace {

using Eigen::Vector3f;
constexpr float kInfinity = std::numeric_limits<float>::infinity();

// The functions below intersect the line o + t·d, given in the object's frame.

VerticalIntersection overlap_of(const VerticalIntersection& a, const VerticalIntersection& b) {
  return {std::max(a.low, b.low), std::min(a.high, b.high)};
}

// Union of the intervals of two parts of one convex shape.
VerticalIntersection hull_of(const VerticalIntersection& a, const VerticalIntersection& b) {
  if (a.low > a.high) return b;
  if (b.low > b.high) return a;
  return {std::min(a.low, b.low), std::max(a.high, b.high)};
}

// The t with low ≤ o + t·d ≤ high.
VerticalIntersection slab_interval(float o, float d, float low, float high) {
  if (std::abs(d) < 1e-12F)
    return o < low || o > high ? VerticalIntersection{} : VerticalIntersection{-kInfinity, kInfinity};
  const float a = (low - o) / d, b = (high - o) / d;
  return {std::min(a, b), std::max(a, b)};
}

// The t with a·t² + 2·b·t + c ≤ 0. Precondition: a > 0.
VerticalIntersection quadratic_interval(float a, float b, float c) {
  const float discriminant = b * b - a * c;
  if (discriminant < 0.0F) return {};
  const float root = std::sqrt(discriminant);
  return {(-b - root) / a, (-b + root) / a};
}

VerticalIntersection sphere_interval(const Vector3f& o, const Vector3f& d, float radius) {
  return quadratic_interval(d.squaredNorm(), o.dot(d), o.squaredNorm() - radius * radius);
}

VerticalIntersection cylinder_interval(const Vector3f& o, const Vector3f& d, float radius, float half) {
  const VerticalIntersection slab = slab_interval(o.z(), d.z(), -half, half);
  const float a = d.head<2>().squaredNorm(), c = o.head<2>().squaredNorm() - radius * radius;
  if (a < 1e-12F) return c <= 0.0F ? slab : VerticalIntersection{};
  return overlap_of(slab, quadratic_interval(a, o.head<2>().dot(d.head<2>()), c));
}

VerticalIntersection capsule_interval(const Vector3f& o, const Vector3f& d, float radius, float half) {
  const Vector3f end(0.0F, 0.0F, half);
  return hull_of(cylinder_interval(o, d, radius, half),
                 hull_of(sphere_interval(o - end, d, radius), sphere_interval(o + end, d, radius)));
}

// A cone of height h with its centre of mass at the origin: base at z = −h/4, tip at z = 3h/4.
VerticalIntersection cone_interval(const Vector3f& o, const Vector3f& d, float radius, float height) {
  const VerticalIntersection slab = slab_interval(o.z(), d.z(), -0.25F * height, 0.75F * height);
  const float slope = radius / height, depth = 0.75F * height - o.z();  // the radius at z is slope·(3h/4 − z)
  const float a = d.head<2>().squaredNorm() - slope * slope * d.z() * d.z();
  const float b = o.head<2>().dot(d.head<2>()) + slope * slope * depth * d.z();
  const float c = o.head<2>().squaredNorm() - slope * slope * depth * depth;
  if (a > 1e-9F) return overlap_of(slab, quadratic_interval(a, b, c));
  if (std::abs(a) <= 1e-9F)  // parallel to the side: a single root
    return std::abs(b) < 1e-12F
               ? (c <= 0.0F ? slab : VerticalIntersection{})
               : overlap_of(slab, b > 0.0F ? VerticalIntersection{-kInfinity, -c / (2.0F * b)}
                                           : VerticalIntersection{-c / (2.0F * b), kInfinity});
  // Steeper than the side: inside before one root or beyond the other, whichever lies on the lower nappe.
  const float discriminant = b * b - a * c;
  if (discriminant < 0.0F) return slab;
  const float root = std::sqrt(discriminant), near = (-b + root) / a, far = (-b - root) / a;
  return overlap_of(
      slab, d.z() > 0.0F ? VerticalIntersection{-kInfinity, near} : VerticalIntersection{far, kInfinity});
}

VerticalIntersection convex_interval(const Vector3f& o, const Vector3f& d, const scene::ConvexHull& hull) {
  VerticalIntersection interval{-kInfinity, kInfinity};
  for (const auto& face : hull.faces) {
    const float rate = face.normal.dot(d), gap = face.offset - face.normal.dot(o);
    if (std::abs(rate) < 1e-12F) {
      if (gap < 0.0F) return {};
    } else if (rate > 0.0F) {
      interval.high = std::min(interval.high, gap / rate);
    } else {
      interval.low = std::max(interval.low, gap / rate);
    }
  }
  return interval;
}

}  // namespace

VerticalIntersector::VerticalIntersector(const scene::ObjectSpec& object,
                                         const Eigen::Quaternionf& orientation)
    : object_(object), half_extents_(object.half_extents().cast<float>()) {
  const Eigen::Matrix3f to_world = orientation.toRotationMatrix();
  to_local_ = to_world.transpose();
  const Vector3f extent = object.shape == scene::ShapeKind::kSphere
                              ? half_extents_
                              : Vector3f(to_world.cwiseAbs() * half_extents_);
  horizontal_reach_ = std::max(extent.x(), extent.y());
}

VerticalIntersection VerticalIntersector::intersect(float dx, float dy) const {
  const Vector3f o = to_local_ * Vector3f(dx, dy, 0.0F), d = to_local_.col(2);
  const auto radius = static_cast<float>(object_.radius), height = static_cast<float>(object_.height);
  switch (object_.shape) {
    case scene::ShapeKind::kSphere:
      return sphere_interval(o, d, radius);
    case scene::ShapeKind::kBox:
      return overlap_of(slab_interval(o.x(), d.x(), -half_extents_.x(), half_extents_.x()),
                        overlap_of(slab_interval(o.y(), d.y(), -half_extents_.y(), half_extents_.y()),
                                   slab_interval(o.z(), d.z(), -half_extents_.z(), half_extents_.z())));
    case scene::ShapeKind::kCylinder:
      return cylinder_interval(o, d, radius, 0.5F * height);
    case scene::ShapeKind::kCapsule:
      return capsule_interval(o, d, radius, 0.5F * height - radius);
    case scene::ShapeKind::kCone:
      return cone_interval(o, d, radius, height);
    case scene::ShapeKind::kSolid:
      return intersect_solid(o, d);
  }
  return {};
}

VerticalIntersection VerticalIntersector::intersect_solid(const Vector3f& o, const Vector3f& d) const {
  VerticalIntersection all;
  for (const scene::ConvexHull& hull : object_.solid->hulls) {
    const VerticalIntersection one = convex_interval(o, d, hull);
    if (one.low <= one.high) all = hull_of(all, one);
  }
  return all;
}

}  // namespace smartsurf::surface

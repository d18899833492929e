#include "smartsurf/surface/Crossing.h"

#include <algorithm>
#include <cmath>

namespace smartsurf::surface {
namespace {

using Eigen::Vector3f;
constexpr float kInfinity = std::numeric_limits<float>::infinity();

// Everything below is about the line o + t·d in the object's own frame.

Crossing common(const Crossing& a, const Crossing& b) {
  return {std::max(a.low, b.low), std::min(a.high, b.high)};
}

// Of two parts of one convex whole.
Crossing together(const Crossing& a, const Crossing& b) {
  if (a.low > a.high) return b;
  if (b.low > b.high) return a;
  return {std::min(a.low, b.low), std::max(a.high, b.high)};
}

// Where low ≤ o + t·d ≤ high.
Crossing slab(float o, float d, float low, float high) {
  if (std::abs(d) < 1e-12F) return o < low || o > high ? Crossing{} : Crossing{-kInfinity, kInfinity};
  const float a = (low - o) / d, b = (high - o) / d;
  return {std::min(a, b), std::max(a, b)};
}

// Where a·t² + 2·b·t + c ≤ 0; a > 0.
Crossing inside(float a, float b, float c) {
  const float discriminant = b * b - a * c;
  if (discriminant < 0.0F) return {};
  const float root = std::sqrt(discriminant);
  return {(-b - root) / a, (-b + root) / a};
}

Crossing sphere(const Vector3f& o, const Vector3f& d, float radius) {
  return inside(d.squaredNorm(), o.dot(d), o.squaredNorm() - radius * radius);
}

Crossing tube(const Vector3f& o, const Vector3f& d, float radius, float half) {
  const Crossing between = slab(o.z(), d.z(), -half, half);
  const float a = d.head<2>().squaredNorm(), c = o.head<2>().squaredNorm() - radius * radius;
  if (a < 1e-12F) return c <= 0.0F ? between : Crossing{};
  return common(between, inside(a, o.head<2>().dot(d.head<2>()), c));
}

Crossing capsule(const Vector3f& o, const Vector3f& d, float radius, float half) {
  const Vector3f end(0.0F, 0.0F, half);
  return together(tube(o, d, radius, half), together(sphere(o - end, d, radius), sphere(o + end, d, radius)));
}

// A cone of height h about its centre of mass: its base at −h/4, its tip at 3h/4.
Crossing cone(const Vector3f& o, const Vector3f& d, float radius, float height) {
  const Crossing between = slab(o.z(), d.z(), -0.25F * height, 0.75F * height);
  const float slope = radius / height, depth = 0.75F * height - o.z();  // the radius at z is slope·(3h/4 − z)
  const float a = d.head<2>().squaredNorm() - slope * slope * d.z() * d.z();
  const float b = o.head<2>().dot(d.head<2>()) + slope * slope * depth * d.z();
  const float c = o.head<2>().squaredNorm() - slope * slope * depth * depth;
  if (a > 1e-9F) return common(between, inside(a, b, c));
  if (std::abs(a) <= 1e-9F)  // along the cone's side: one crossing of it
    return std::abs(b) < 1e-12F ? (c <= 0.0F ? between : Crossing{})
                                : common(between, b > 0.0F ? Crossing{-kInfinity, -c / (2.0F * b)}
                                                           : Crossing{-c / (2.0F * b), kInfinity});
  // Steeper than the side: inside beyond one root or before the other, whichever is on this nappe.
  const float discriminant = b * b - a * c;
  if (discriminant < 0.0F) return between;
  const float root = std::sqrt(discriminant), near = (-b + root) / a, far = (-b - root) / a;
  return common(between, d.z() > 0.0F ? Crossing{-kInfinity, near} : Crossing{far, kInfinity});
}

Crossing polyhedron(const Vector3f& o, const Vector3f& d, const scene::ConvexPiece& piece) {
  Crossing line{-kInfinity, kInfinity};
  for (const auto& face : piece.faces) {
    const float rate = face.normal.dot(d), gap = face.offset - face.normal.dot(o);
    if (std::abs(rate) < 1e-12F) {
      if (gap < 0.0F) return {};
    } else if (rate > 0.0F) {
      line.high = std::min(line.high, gap / rate);
    } else {
      line.low = std::max(line.low, gap / rate);
    }
  }
  return line;
}

}  // namespace

CrossedObject::CrossedObject(const scene::ObjectSpec& object, const Eigen::Quaternionf& orientation)
    : object_(object), half_(object.half_extents().cast<float>()) {
  const Eigen::Matrix3f to_world = orientation.toRotationMatrix();
  to_local_ = to_world.transpose();
  const Vector3f extent =
      object.shape == scene::ShapeKind::kSphere ? half_ : Vector3f(to_world.cwiseAbs() * half_);
  reach_ = std::max(extent.x(), extent.y());
}

Crossing CrossedObject::at(float dx, float dy) const {
  const Vector3f o = to_local_ * Vector3f(dx, dy, 0.0F), d = to_local_.col(2);
  const auto radius = static_cast<float>(object_.radius), height = static_cast<float>(object_.height);
  switch (object_.shape) {
    case scene::ShapeKind::kSphere:
      return sphere(o, d, radius);
    case scene::ShapeKind::kBox:
      return common(
          slab(o.x(), d.x(), -half_.x(), half_.x()),
          common(slab(o.y(), d.y(), -half_.y(), half_.y()), slab(o.z(), d.z(), -half_.z(), half_.z())));
    case scene::ShapeKind::kCylinder:
      return tube(o, d, radius, 0.5F * height);
    case scene::ShapeKind::kCapsule:
      return capsule(o, d, radius, 0.5F * height - radius);
    case scene::ShapeKind::kCone:
      return cone(o, d, radius, height);
    case scene::ShapeKind::kSolid:
      return solid(o, d);
  }
  return {};
}

Crossing CrossedObject::solid(const Vector3f& o, const Vector3f& d) const {
  Crossing all;
  for (const scene::ConvexPiece& piece : object_.solid->pieces) {
    const Crossing one = polyhedron(o, d, piece);
    if (one.low <= one.high) all = together(all, one);
  }
  return all;
}

}  // namespace smartsurf::surface

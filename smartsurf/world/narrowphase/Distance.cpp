#include "smartsurf/world/narrowphase/Distance.h"

#include <algorithm>
#include <cmath>

namespace smartsurf::world {
namespace {

using scene::ShapeKind;

Vec3 unit_or(const Vec3& v, const Vec3& fallback) {
  const float length = v.norm();
  return length > 1e-9F ? Vec3(v / length) : fallback;
}

SignedDistance box_distance(const Vec3& p, const Vec3& half) {
  const Vec3 excess = p.cwiseAbs() - half;
  const Vec3 sign(std::copysign(1.0F, p.x()), std::copysign(1.0F, p.y()), std::copysign(1.0F, p.z()));
  const Vec3 outside = excess.cwiseMax(0.0F);
  if (const float d = outside.norm(); d > 1e-6F) return {outside.cwiseProduct(sign) / d, d};
  Eigen::Index axis = 0;
  const float nearest = excess.maxCoeff(&axis);
  Vec3 outward = Vec3::Zero();
  outward[axis] = sign[axis];
  return {outward, nearest};
}

// A point in the meridian half plane of a solid of revolution: z along the axis, r from the axis along
// `radial`.
struct MeridianPoint {
  float r, z;
  Vec3 radial;
  explicit MeridianPoint(const Vec3& p) : r(length_of(p.x(), p.y())), z(p.z()) {
    radial = r > 1e-9F ? Vec3(p.x() / r, p.y() / r, 0) : Vec3(1, 0, 0);
  }
  Vec3 to_space(float along_r, float along_z) const { return radial * along_r + Vec3(0, 0, along_z); }
};

SignedDistance cylinder_distance(const Vec3& p, float radius, float half_height) {
  const MeridianPoint m(p);
  const float side = std::copysign(1.0F, m.z);
  const float over_r = m.r - radius, over_z = std::abs(m.z) - half_height;
  const float out_r = std::max(0.0F, over_r), out_z = std::max(0.0F, over_z);
  if (const float d = length_of(out_r, out_z); d > 1e-6F) return {m.to_space(out_r / d, side * out_z / d), d};
  return over_r > over_z ? SignedDistance{m.radial, over_r} : SignedDistance{Vec3(0, 0, side), over_z};
}

SignedDistance capsule_distance(const Vec3& p, float radius, float half_height) {
  const float end = std::max(0.0F, half_height - radius);
  const Vec3 from(p.x(), p.y(), p.z() - std::clamp(p.z(), -end, end));
  return {unit_or(from, Vec3(1, 0, 0)), from.norm() - radius};
}

SignedDistance cone_distance(const Vec3& p, const Shape& s) {
  const MeridianPoint m(p);
  const float height = s.high - s.low, slant = length_of(height, s.radius);
  const float nr = height / slant, nz = s.radius / slant;  // outward normal of the lateral surface
  const float over_mantle = (m.r - s.radius) * nr + (m.z - s.low) * nz, over_base = s.low - m.z;
  // Position on the lateral surface, from the rim (0) to the tip (slant).
  const float along = (s.radius - m.r) * nz + (m.z - s.low) * nr;
  if (over_mantle <= 0.0F && over_base <= 0.0F)
    return over_mantle > over_base ? SignedDistance{m.to_space(nr, nz), over_mantle}
                                   : SignedDistance{Vec3(0, 0, -1), over_base};
  if (over_base > 0.0F && m.r <= s.radius) return {Vec3(0, 0, -1), over_base};
  if (along >= 0.0F && along <= slant) return {m.to_space(nr, nz), over_mantle};
  const float r = along < 0.0F ? m.r - s.radius : m.r, z = along < 0.0F ? m.z - s.low : m.z - s.high;
  const float d = length_of(r, z);
  return d > 1e-6F ? SignedDistance{m.to_space(r / d, z / d), d} : SignedDistance{m.to_space(nr, nz), 0.0F};
}

// The closest point of a convex polygon to a point in its plane.
Vec3 closest_on_face(const scene::ConvexHull& hull, const scene::ConvexHull::Face& face, const Vec3& foot) {
  Vec3 best = foot;
  float min_distance_squared = -1.0F;
  for (std::uint32_t i = 0; i < face.vertex_count; ++i) {
    const Vec3& a = hull.vertices[hull.face_vertices[face.first_vertex + i]];
    const Vec3& b = hull.vertices[hull.face_vertices[face.first_vertex + (i + 1) % face.vertex_count]];
    const Vec3 edge = b - a;
    if (edge.cross(face.normal).dot(foot - a) <= 0.0F) continue;  // inside this edge
    const float t = std::clamp(edge.dot(foot - a) / edge.squaredNorm(), 0.0F, 1.0F);
    const Vec3 on_edge = a + t * edge;
    const float distance_squared = (on_edge - foot).squaredNorm();
    if (min_distance_squared < 0.0F || distance_squared < min_distance_squared)
      min_distance_squared = distance_squared, best = on_edge;
  }
  return best;
}

SignedDistance hull_distance(const Vec3& p, const ConvexHullShape& hull, float limit) {
  const scene::ConvexHull& source = *hull.hull;
  auto height = [&](std::size_t face) {
    return source.faces[face].normal.dot(p) - source.faces[face].offset;
  };
  const std::size_t top_face = hull.face_planes.argmax(p);
  const Vec3& normal = source.faces[top_face].normal;
  const float max_height = height(top_face);
  if (max_height <= 0.0F || max_height > limit) return {normal, max_height};
  // The greatest plane distance is a lower bound, attained if the point projects into that face.
  const Vec3 foot = p - normal * max_height;
  Vec3 best = closest_on_face(source, source.faces[top_face], foot);
  if (best == foot) return {normal, max_height};
  float min_distance_squared = (p - best).squaredNorm();
  // `best` is the closest point if the plane through it, perpendicular to the offset, supports the hull.
  constexpr float kPrecision = 1e-5F;
  const Vec3 offset = p - best;
  const Vec3& farthest = source.vertices[hull.corner_blocks.argmax(offset)];
  if (const float beyond = offset.dot(farthest - best); beyond <= kPrecision * min_distance_squared)
    return {unit_or(offset, normal), std::sqrt(min_distance_squared)};
  hull.face_planes.for_each_above(p, 0.0F, [&](std::size_t face) {
    const float over = height(face);
    if (face == top_face || over * over >= min_distance_squared) return;
    const Vec3 q = closest_on_face(source, source.faces[face], p - source.faces[face].normal * over);
    const float distance_squared = (p - q).squaredNorm();
    if (distance_squared < min_distance_squared) min_distance_squared = distance_squared, best = q;
  });
  return {unit_or(p - best, normal), std::sqrt(min_distance_squared)};
}

}  // namespace

SignedDistance signed_distance(const ConvexPart& part, const Vec3& p, float limit) {
  const Shape& s = part.shape;
  switch (s.kind) {
    case ShapeKind::kSphere:
      return {unit_or(p, Vec3(0, 0, 1)), p.norm() - s.radius};
    case ShapeKind::kBox:
      return box_distance(p, s.half_extents);
    case ShapeKind::kCylinder:
      return cylinder_distance(p, s.radius, s.high);
    case ShapeKind::kCapsule:
      return capsule_distance(p, s.radius, s.high);
    case ShapeKind::kCone:
      return cone_distance(p, s);
    case ShapeKind::kSolid:
      return hull_distance(p, *part.hull, limit);
  }
  return {Vec3(0, 0, 1), 0.0F};
}

}  // namespace smartsurf::world

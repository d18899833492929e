#include "smartsurf/world/narrowphase/InternalEdges.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <vector>

#include "smartsurf/world/narrowphase/Distance.h"

namespace smartsurf::world {
namespace {

constexpr float kLevel = 3e-3F;         // faces are level up to this, u
constexpr float kGap = 1e-3F;           // and continue each other across gaps up to this, u
constexpr float kMinCosine = 0.99999F;  // between the normals of level faces
constexpr float kMinTilt =
    3e-4F;  // sine of the angle between face and contact normal of a contact at an edge
// Beyond the edge the other part is looked for at the first of these distances that is clear of the part, u.
constexpr float kProbes[] = {5e-3F, 0.02F, 0.05F};
constexpr float kClear = 2e-3F;
constexpr float kSameNormal = 0.99F;  // cosine

struct Plane {
  Vec3 normal, point;
};

// Calls visit(normal, offset) for the faces, in body axes.
template <class Visit>
void for_each_face(const ConvexPart& part, Visit visit) {
  if (part.hull != nullptr)
    for (const auto& face : part.hull->hull->faces) visit(face.normal, face.offset);
  else if (part.shape.kind == scene::ShapeKind::kBox)
    for (int axis = 0; axis < 3; ++axis)
      for (const float sign : {1.0F, -1.0F})
        visit(Vec3(sign * Vec3::Unit(axis)), part.shape.half_extents[axis]);
}

// A contact point is at an edge of a face if it is this close to its plane, u: bodies overlap a little, and
// round off each other's edges by their convex radius.
constexpr float kMinEdgeDepth = 0.02F;
float edge_depth(const ConvexPart& part) {
  constexpr float kAllowance = 0.005F;
  const float radius = part.hull != nullptr ? part.hull->convex_radius : part.shape.convex_radius;
  return std::max(kMinEdgeDepth, kAllowance + radius);
}

bool is_near(const ConvexPart& part, const Vec3& local, float reach) {
  if (part.hull == nullptr) return (local.cwiseAbs() - part.shape.half_extents).maxCoeff() <= reach;
  const scene::ConvexHull& hull = *part.hull->hull;
  return (hull.bounds_min - local).cwiseMax(local - hull.bounds_max).maxCoeff() <= reach;
}

// A bound of |p| for the points that are near.
float greatest_near_distance(const ConvexPart& part, float reach) {
  if (part.hull == nullptr) return (part.shape.half_extents + Vec3::Constant(reach)).norm();
  const scene::ConvexHull& hull = *part.hull->hull;
  return (hull.bounds_max.cwiseAbs().cwiseMax(hull.bounds_min.cwiseAbs()) + Vec3::Constant(reach)).norm();
}

bool are_same(const ConvexPart& a, const ConvexPart& b) { return &a.shape == &b.shape && a.hull == b.hull; }

template <class Visit>
void for_each_solid_part(std::span<const Solid> solids, Visit visit) {
  for (std::size_t i = 0; i < solids.size(); ++i)
    for_each_part(solids[i].shape, [&](const ConvexPart& part) { visit(i, part); });
}

// True if a part other than that which `is_own` names has a face in the plane at its point.
template <class IsOwn>
bool is_continued(std::span<const Solid> solids, IsOwn is_own, const Plane& plane) {
  bool found = false;
  for_each_solid_part(solids, [&](std::size_t i, const ConvexPart& part) {
    if (found || is_own(i, part)) return;
    const Solid& solid = solids[i];
    const Vec3 local = solid.axes.transpose() * (plane.point - solid.centre);
    if (!is_near(part, local, kLevel)) return;
    const Vec3 normal = solid.axes.transpose() * plane.normal;
    for_each_face(part, [&](const Vec3& face, float offset) {
      if (found || face.dot(normal) <= kMinCosine) return;
      const float height = face.dot(local) - offset;
      found =
          std::abs(height) <= kLevel && signed_distance(part, local - height * face, kGap).distance <= kGap;
    });
  });
  return found;
}

// True if another part lies on the plane at its point, as the next tile of a floor does on the side of a
// tile.
template <class IsOwn>
bool is_covered(std::span<const Solid> solids, IsOwn is_own, const Plane& plane) {
  const Vec3 above = plane.point + kProbes[0] * plane.normal;
  bool found = false;
  for_each_solid_part(solids, [&](std::size_t i, const ConvexPart& part) {
    if (found || is_own(i, part)) return;
    const Solid& solid = solids[i];
    const Vec3 local = solid.axes.transpose() * (above - solid.centre);
    found = is_near(part, local, kGap) && signed_distance(part, local, kGap).distance <= kGap;
  });
  return found;
}

// False if fewer than two parts come so near the point that one may continue a face of another there.
bool may_be_internal(std::span<const Solid> solids, const Vec3& point) {
  constexpr float kRounding = 2e-3F;  // u
  float reach = 0.0F;
  for_each_solid_part(solids, [&](std::size_t, const ConvexPart& part) {
    reach = std::max(reach, edge_depth(part) + kProbes[2] + kLevel + kRounding);
  });
  int near = 0;
  for_each_solid_part(solids, [&](std::size_t i, const ConvexPart& part) {
    if (near < 2)
      near += static_cast<int>(is_near(part, solids[i].axes.transpose() * (point - solids[i].centre), reach));
  });
  return near >= 2;
}

// The plane in which a contact at `point`, with the unit normal out of the solids, lies; none if it is no
// internal edge. Of several, one that no part covers, and that nearest to the contact's normal, or to its
// point.
std::optional<Plane> plane_of(std::span<const Solid> solids, const Vec3& point, const Vec3& normal) {
  constexpr float kSameCosine = 1e-4F;
  std::optional<Plane> found;
  if (!may_be_internal(solids, point)) return found;
  float best_cosine = 0.0F, best_distance = 0.0F;
  bool is_best_covered = false;
  for_each_solid_part(solids, [&](std::size_t i, const ConvexPart& part) {
    const Solid& solid = solids[i];
    const Vec3 local = solid.axes.transpose() * (point - solid.centre),
               direction = solid.axes.transpose() * normal;
    const float depth = edge_depth(part);
    if (!is_near(part, local, depth)) return;
    for_each_face(part, [&](const Vec3& face, float offset) {
      const float height = face.dot(local) - offset, cosine = face.dot(direction),
                  distance = std::abs(height);
      if (distance > depth || cosine < -kMinTilt) return;
      const bool is_nearer = !found || cosine > best_cosine + kSameCosine ||
                             (cosine >= best_cosine - kSameCosine && distance < best_distance);
      if (!is_nearer && !is_best_covered) return;
      const Vec3 tangent = direction - cosine * face;
      const float tilt = tangent.norm();
      if (tilt < kMinTilt) return;
      const Vec3 foot = local - height * face, outward = tangent / tilt;
      for (const float probe : kProbes) {
        const Vec3 beyond = foot + probe * outward;
        if (signed_distance(part, beyond).distance < kClear) continue;
        const Plane plane{solid.axes * face, solid.centre + solid.axes * beyond};
        const auto is_own = [&](std::size_t k, const ConvexPart& other) {
          return k == i && are_same(part, other);
        };
        if (!is_continued(solids, is_own, plane)) break;
        const bool covered = is_covered(solids, is_own, plane);
        if (covered == is_best_covered ? is_nearer : is_best_covered || !found)
          found = plane, best_cosine = cosine, best_distance = distance, is_best_covered = covered;
        break;
      }
    });
  });
  return found;
}

// True if the contact point `on_body`, from the body's origin, is on a round side but beside the line along
// which that side touches the plane, and a face lies in the plane under that line: another contact bears
// there, and rolling brings the side no nearer at the point. `at_point`: the plane at the point.
bool bears_beside(std::span<const Solid> solids, const Shape& body, const Mat3& axes, const Vec3& origin,
                  const Vec3& on_body, const Plane& at_point) {
  constexpr float kMaxAlong = 0.7F;  // an end
  constexpr float kAside = 1e-3F;    // u
  if (!body.is_axisymmetric()) return false;
  const Vec3 axis = axes.col(2);
  const Vec3& normal = at_point.normal;
  const float normal_along = normal.dot(axis), along = on_body.dot(axis);
  if (std::abs(normal_along) > kMaxAlong) return false;
  Vec3 lowest;
  if (body.kind == scene::ShapeKind::kCapsule) {
    const float end = std::max(0.0F, body.high - body.radius);
    lowest = std::clamp(along, -end, end) * axis - body.radius * normal;
  } else {
    const Vec3 down = (normal_along * axis - normal).normalized();
    lowest = along * axis + (on_body - along * axis).norm() * down;
  }
  const Vec3 aside = lowest - on_body;
  if ((aside - aside.dot(normal) * normal).squaredNorm() < kAside * kAside) return false;
  const Vec3 above = origin + lowest;
  const Plane plane{normal, above - normal.dot(above - at_point.point) * normal};
  return is_continued(
      solids, [](std::size_t, const ConvexPart&) { return false; }, plane);
}

}  // namespace

bool may_have_internal_edges(std::span<const Solid> solids) {
  return solids.size() > 1 || (solids.size() == 1 && solids[0].shape.hulls.size() > 1);
}

bool may_continue(const Shape& shape, const Vec3& local) {
  bool found = false;
  for_each_part(shape, [&](const ConvexPart& part) {
    found = found || is_near(part, local, kProbes[2] + edge_depth(part));
  });
  return found;
}

float greatest_continued_distance(const Shape& shape) {
  float greatest = 0.0F;
  for_each_part(shape, [&](const ConvexPart& part) {
    greatest = std::max(greatest, greatest_near_distance(part, kProbes[2] + edge_depth(part)));
  });
  return greatest;
}

void mark_internal_edges(std::span<const Solid> solids, bool are_b, const Shape& body, const Mat3& axes,
                         std::span<const SeamContact> contacts) {
  // Normals and heights are those of the solids' side.
  const float side = are_b ? 1.0F : -1.0F;
  const bool is_sphere = body.is_sphere();
  const float sphere_radius = is_sphere ? body.bounding_radius : 0.0F;
  thread_local std::vector<std::optional<Plane>> planes;
  planes.clear();
  bool any = false;
  // The point of a sphere's contact is on body a. That of other shapes is anywhere between the surfaces.
  const float share = !is_sphere ? 0.5F : are_b ? 1.0F : 0.0F;
  const auto point_on_solid = [&](const SeamContact& s, float of_separation) -> Vec3 {
    return s.from + s.contact->anchor - side * of_separation * s.contact->separation * s.contact->normal;
  };
  for (const SeamContact& s : contacts) {
    const Vec3 normal = side * s.contact->normal;
    std::optional<Plane> plane = plane_of(solids, point_on_solid(s, share), normal);
    if (!is_sphere && s.contact->separation > kMinEdgeDepth)
      for (const float other : {0.0F, 1.0F})
        if (!plane) plane = plane_of(solids, point_on_solid(s, other), normal);
    any |= plane.has_value();
    planes.push_back(plane);
  }
  if (!any && !body.is_axisymmetric()) return;
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    Contact& c = *contacts[i].contact;
    const Vec3 bearing = planes[i] ? planes[i]->normal : Vec3(side * c.normal);
    const Vec3 on_solid = point_on_solid(contacts[i], share);
    if (bears_beside(solids, body, axes, contacts[i].origin,
                     on_solid + c.separation * side * c.normal - contacts[i].origin, {bearing, on_solid})) {
      c.separation = kSpareSeparation;
      continue;
    }
    if (!planes[i]) continue;
    const Vec3& normal = planes[i]->normal;
    const auto has_normal = [&](std::size_t k) {
      const Contact& other = *contacts[k].contact;
      return (k < i || !planes[k]) && other.separation != kSpareSeparation &&
             side * other.normal.dot(normal) > kSameNormal;
    };
    // A flat body bears on such points as well; a sphere has one in a plane.
    bool is_spare = false;
    const bool may_bear = !is_sphere && side * c.normal.dot(normal) > kSameNormal;
    for (std::size_t k = 0; k < contacts.size() && !is_spare && !may_bear; ++k)
      is_spare = k != i && has_normal(k);
    if (is_spare) {
      c.separation = kSpareSeparation;
      continue;
    }
    const Vec3 old_normal = side * c.normal;
    const Vec3 on_body = point_on_solid(contacts[i], share) + c.separation * old_normal +
                         sphere_radius * (old_normal - normal);
    c.normal = side * normal;
    c.separation = normal.dot(on_body - planes[i]->point);
    c.anchor = on_body - contacts[i].from;
    if (!is_sphere || !are_b) c.anchor -= (is_sphere ? 1.0F : 0.5F) * c.separation * normal;
  }
}

bool correct_internal_edges(const Solid& a, const Solid& b, std::vector<Contact>& contacts,
                            std::size_t first) {
  if (a.shape.hulls.size() < 2 && b.shape.hulls.size() < 2) return false;
  const std::size_t count = contacts.size();
  thread_local std::vector<SeamContact> seam;
  for (const Solid* solid : {&b, &a}) {
    const Solid& other = solid == &b ? a : b;
    if (solid->shape.hulls.size() < 2 || contacts.size() == first) continue;
    seam.clear();
    for (std::size_t k = first; k < contacts.size(); ++k)
      seam.push_back({&contacts[k], a.centre, other.centre});
    mark_internal_edges({solid, 1}, solid == &b, other.shape, other.axes, seam);
    erase_spare(contacts, first);
  }
  return contacts.size() < count;
}

void erase_spare(std::vector<Contact>& contacts, std::size_t first) {
  const auto marked = std::remove_if(contacts.begin() + first, contacts.end(),
                                     [](const Contact& c) { return c.separation == kSpareSeparation; });
  contacts.erase(marked, contacts.end());
}

}  // namespace smartsurf::world

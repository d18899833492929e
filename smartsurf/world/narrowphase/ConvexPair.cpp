#include "smartsurf/world/narrowphase/ConvexPair.h"

#include <algorithm>
#include <cmath>

#include "smartsurf/world/narrowphase/Gjk.h"
#include "smartsurf/world/narrowphase/SupportFeature.h"

namespace smartsurf::world {
namespace {

using scene::ShapeKind;

struct ContactCandidate {
  Vec3 normal;  // from b to a
  float separation;
  Vec3 point;
};

// Calls try_direction(n) for candidate directions of least penetration of the part, world frame.
template <class Try>
void for_each_escape(const ConvexProxy& c, const Vec3& towards, Try try_direction) {
  if (c.part.hull) {
    for (const auto& face : c.part.hull->hull->faces) try_direction(Vec3(c.axes * face.normal));
    return;
  }
  const bool box = c.part.shape.kind == ShapeKind::kBox;
  for (int axis = box ? 0 : 2; axis < 3; ++axis) {
    try_direction(Vec3(c.axes.col(axis)));
    try_direction(Vec3(-c.axes.col(axis)));
  }
  if (box) return;
  const Vec3 across = towards - c.axes.col(2) * c.axes.col(2).dot(towards);
  if (const float length = across.norm(); length > 1e-6F) try_direction(Vec3(across / length));
}

// The direction to separate overlapping cores: that of least penetration among the face normals of both
// parts.
ContactCandidate find_deepest(const ConvexProxy& a, const ConvexProxy& b) {
  ContactCandidate best{{0, 0, 1}, -std::numeric_limits<float>::max(), {}};
  auto try_direction = [&](const Vec3& n) {
    const Vec3 on_a = a.support_with_radius(-n), on_b = b.support_with_radius(n);
    if (const float separation = n.dot(on_a - on_b); separation > best.separation)
      best = {n, separation, 0.5F * (on_a + on_b)};
  };
  const Vec3 offset = a.centre - b.centre;
  for_each_escape(b, offset, try_direction);
  for_each_escape(a, -offset, [&](const Vec3& n) { try_direction(-n); });
  if (const float length = offset.norm(); length > 1e-6F) try_direction(offset / length);
  return best;
}

// Parts with a separation up to `margin` get contacts. Greater separations are computed up to `horizon`, u.
struct SearchLimits {
  float margin, horizon;
};

// Results of the previous step; either may be null.
struct CachedAxis {
  const Vec3* normal;
  SimplexCache* simplex;
};

// Returns whether the separation is within the margin. If not, only `out.separation` is valid.
bool find_contact(const ConvexProxy& a, const ConvexProxy& b, const SearchLimits& limits,
                  const CachedAxis& cached, ContactCandidate& out) {
  const ClosestPoints closest =
      closest_points(a, b, limits.horizon + a.convex_radius + b.convex_radius,
                     cached.normal ? *cached.normal : Vec3(a.centre - b.centre), cached.simplex);
  if (!closest.separated) {
    out = find_deepest(a, b);
    return true;
  }
  out.separation = closest.distance - a.convex_radius - b.convex_radius;
  out.normal = closest.normal;
  out.point = 0.5F * (closest.on_a - a.convex_radius * closest.normal + closest.on_b +
                      b.convex_radius * closest.normal);
  return out.separation <= limits.margin;
}

SupportFeature proxy_feature(const ConvexProxy& c, const Vec3& direction) {
  return support_feature(c.part, c.centre, c.axes, direction);
}

enum class CacheResult { kSeparated, kTouching, kUnknown };

// Tests the face that supplied the previous normal, to avoid GJK. The other part's feature is clipped to that
// face; if the clipped patch contains the deepest point of the other part, the face normal is still the axis
// of least penetration.
CacheResult test_cached_axis(const ConvexProxy& a, const ConvexProxy& b, float margin,
                             const Vec3& cached_normal, ManifoldReducer& out, float& clearance) {
  constexpr float kMinAlignment = 0.98F, kTolerance = 2e-4F;
  const float alignment_a = face_alignment(a.part, a.axes, -cached_normal);
  const float alignment_b = face_alignment(b.part, b.axes, cached_normal);
  if (std::max(alignment_a, alignment_b) < kMinAlignment) return CacheResult::kUnknown;
  const bool from_a = alignment_a > alignment_b + 1e-3F;
  const SupportFeature face = from_a ? proxy_feature(a, -cached_normal) : proxy_feature(b, cached_normal);
  const ConvexProxy& other = from_a ? b : a;
  auto height_above_face = [&face](const Vec3& p) { return face.normal.dot(p - face.point[0]); };
  const float separation = height_above_face(other.support_with_radius(-face.normal));
  if (separation > margin) {
    clearance = separation;
    return CacheResult::kSeparated;
  }
  if (separation < -a.convex_radius - b.convex_radius) return CacheResult::kUnknown;
  const SupportFeature patch = clip_to_face(proxy_feature(other, -face.normal), face);
  const Vec3 normal = from_a ? Vec3(-face.normal) : face.normal;
  float min_height = std::numeric_limits<float>::max();
  for (int i = 0; i < patch.count; ++i) {
    const Vec3& p = patch.point[i];
    const float height = height_above_face(p);
    min_height = std::min(min_height, height);
    if (height <= margin) out.add({p, normal, height, 0});
  }
  return min_height <= separation + kTolerance ? CacheResult::kTouching : CacheResult::kUnknown;
}

bool has_curved_side(const ConvexProxy& c) { return !c.part.hull && c.part.shape.kind != ShapeKind::kBox; }

// True if add_contact_patch() can add any point.
bool may_share_face(const ConvexProxy& a, const ConvexProxy& b, const Vec3& normal) {
  return (has_curved_side(a) && has_curved_side(b)) ||
         face_alignment(a.part, a.axes, -normal) > kFaceAlignment ||
         face_alignment(b.part, b.axes, normal) > kFaceAlignment;
}

// The support feature of a part with a curved side; of others, its farthest edge.
SupportFeature edge_or_feature(const ConvexProxy& c, const Vec3& direction) {
  const SupportFeature feature = proxy_feature(c, direction);
  return has_curved_side(c) ? feature : farthest_edge(feature, direction);
}

// Returns a lower bound of the separation, or the margin if the parts have contacts.
float collect_candidates(const ConvexProxy& a, const ConvexProxy& b, const SearchLimits& limits,
                         const CachedAxis& cached, ManifoldReducer& out) {
  if (cached.normal) {
    float clearance = limits.margin;
    const CacheResult result = test_cached_axis(a, b, limits.margin, *cached.normal, out, clearance);
    if (result != CacheResult::kUnknown) return clearance;
    out.clear();
  }
  ContactCandidate t;
  if (!find_contact(a, b, limits, cached, t)) return t.separation;
  if (may_share_face(a, b, t.normal))
    add_contact_patch(proxy_feature(a, -t.normal), proxy_feature(b, t.normal), t.normal, limits.margin,
                      PatchPoints::kOnIncident, out);
  // A curved side lies along an edge as it does on a face.
  if (out.count() == 0 && has_curved_side(a) != has_curved_side(b))
    add_contact_patch(edge_or_feature(a, -t.normal), edge_or_feature(b, t.normal), t.normal, limits.margin,
                      PatchPoints::kOnIncident, out);
  if (out.count() == 0) out.add({t.point, t.normal, t.separation, 0});
  return limits.margin;
}

float collide_parts(const ConvexProxy& a, const ConvexProxy& b, const SearchLimits& limits,
                    const CachedAxis& cached, const Vec3& centre, std::vector<Contact>& out) {
  ManifoldReducer candidates;
  const float clearance = collect_candidates(a, b, limits, cached, candidates);
  if (clearance > limits.margin) return clearance;
  const std::size_t first = out.size();
  Vec3 corner[ReductionPoints::kMaxSelected];
  const auto take = [&](const ManifoldCandidate& c) {
    corner[out.size() - first] = c.point;
    Contact& contact = out.emplace_back();
    contact.normal = c.normal;
    contact.anchor = c.point - centre;
    contact.separation = c.separation;
  };
  // Along z: where gravity acts in another direction, this only adds points.
  const ConvexProxy& upper = a.centre.z() > b.centre.z() ? a : b;
  candidates.reduce(take, upper.centre + upper.axes * upper.part.shape.centre_of_mass);
  const float loss = candidates.twist_friction_loss(std::span(corner, out.size() - first));
  for (std::size_t i = first; i < out.size(); ++i) out[i].twist_friction_loss = loss;
  return clearance;
}

}  // namespace

bool is_much_larger(const PlacedShape& box, const PlacedShape& other) {
  return box.shape.kind == ShapeKind::kBox &&
         box.shape.half_extents.maxCoeff() > 6.0F * other.shape.bounding_radius;
}

TrimmedBox trim(const PlacedShape& box, const Vec3& around, float half_width) {
  const Vec3 local_centre = box.axes.transpose() * (around - box.centre),
             half_window = Vec3::Constant(half_width);
  const Vec3 low = (local_centre - half_window).cwiseMax(-box.shape.half_extents),
             high = (local_centre + half_window).cwiseMin(box.shape.half_extents);
  TrimmedBox t{Shape{}, box.centre + box.axes * (0.5F * (low + high)), true};
  t.shape.kind = ShapeKind::kBox;
  t.shape.half_extents = 0.5F * (high - low);
  t.shape.bounding_radius = t.shape.half_extents.norm();
  t.shape.convex_radius = std::min(box.shape.convex_radius, 0.1F * t.shape.half_extents.minCoeff());
  t.overlaps = t.shape.half_extents.minCoeff() > 0.0F;
  return t;
}

float collide_convex(const PlacedShape& a, const PlacedShape& b, float margin, const Vec3* cached_normal,
                     std::vector<Contact>& out, float horizon, SimplexCache* simplex_cache) {
  const Vec3 extent_a = turned_extents(a.axes, a.shape.half_extents),
             extent_b = turned_extents(b.axes, b.shape.half_extents);
  const float bounds_separation = ((a.centre - b.centre).cwiseAbs() - extent_a - extent_b).maxCoeff();
  if (bounds_separation > margin + horizon) return bounds_separation;
  if (is_much_larger(a, b) || is_much_larger(b, a)) {
    const bool a_is_larger = is_much_larger(a, b);
    const PlacedShape &box = a_is_larger ? a : b, &other = a_is_larger ? b : a;
    const float radius = other.shape.bounding_radius;
    const TrimmedBox t = trim(box, other.centre, 2.0F * radius + std::min(margin, radius));
    if (!t.overlaps) return margin;
    const std::size_t first = out.size();
    if (a_is_larger)
      collide_convex({t.shape, t.centre, a.axes}, b, margin, cached_normal, out);
    else
      collide_convex(a, {t.shape, t.centre, b.axes}, margin, cached_normal, out);
    if (a_is_larger)
      for (std::size_t i = first; i < out.size(); ++i) out[i].anchor += t.centre - a.centre;
    return margin;
  }
  const SearchLimits limits{margin, margin + horizon};
  // The simplex cache has space for one pair of parts only.
  const bool single_parts = a.shape.hulls.size() <= 1 && b.shape.hulls.size() <= 1;
  const CachedAxis cached{cached_normal, single_parts ? simplex_cache : nullptr};
  float clearance = limits.horizon;
  const std::size_t first = out.size();
  int patches = 0;
  for_each_part(a.shape, [&](const ConvexPart& part_a) {
    for_each_part(b.shape, [&](const ConvexPart& part_b) {
      const std::size_t before = out.size();
      clearance = std::min(clearance, collide_parts({part_a, a.centre, a.axes}, {part_b, b.centre, b.axes},
                                                    limits, cached, a.centre, out));
      if (out.size() > before) ++patches;
    });
  });
  if (patches > 1) keep_friction_of_twist(std::span(out).subspan(first));
  return clearance;
}

}  // namespace smartsurf::world

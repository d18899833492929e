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

// Directions in which the piece may be left on the shortest way, world frame.
template <class Try>
void for_each_escape(const ConvexProxy& c, const Vec3& towards, Try attempt) {
  if (c.part.hull) {
    for (const auto& face : c.part.hull->hull->faces) attempt(Vec3(c.axes * face.normal));
    return;
  }
  const bool box = c.part.shape.kind == ShapeKind::kBox;
  for (int axis = box ? 0 : 2; axis < 3; ++axis) {
    attempt(Vec3(c.axes.col(axis)));
    attempt(Vec3(-c.axes.col(axis)));
  }
  if (box) return;
  const Vec3 across = towards - c.axes.col(2) * c.axes.col(2).dot(towards);
  if (const float length = across.norm(); length > 1e-6F) attempt(Vec3(across / length));
}

// Cores that overlap: the way out among those of the faces of both.
ContactCandidate deepest(const ConvexProxy& a, const ConvexProxy& b) {
  ContactCandidate best{{0, 0, 1}, -std::numeric_limits<float>::max(), {}};
  auto attempt = [&](const Vec3& n) {
    const Vec3 on_a = a.support_with_radius(-n), on_b = b.support_with_radius(n);
    if (const float gap = n.dot(on_a - on_b); gap > best.separation) best = {n, gap, 0.5F * (on_a + on_b)};
  };
  const Vec3 apart = a.centre - b.centre;
  for_each_escape(b, apart, attempt);
  for_each_escape(a, -apart, [&](const Vec3& n) { attempt(-n); });
  if (const float length = apart.norm(); length > 1e-6F) attempt(apart / length);
  return best;
}

// How near two pieces are looked for: those within the margin touch, what is beyond it is told up to the
// horizon.
struct SearchLimits {
  float margin, horizon;
};

// What is known of the two from before; either may be null.
struct CachedAxis {
  const Vec3* normal;
  SimplexCache* feature;
};

// Where they do not touch, of `out` only the gap is told.
bool find(const ConvexProxy& a, const ConvexProxy& b, const SearchLimits& limits, const CachedAxis& before,
          ContactCandidate& out) {
  const ClosestPoints near =
      closest_points(a, b, limits.horizon + a.convex_radius + b.convex_radius,
                     before.normal ? *before.normal : Vec3(a.centre - b.centre), before.feature);
  if (!near.separated) {
    out = deepest(a, b);
    return true;
  }
  out.separation = near.distance - a.convex_radius - b.convex_radius;
  out.normal = near.normal;
  out.point = 0.5F * (near.on_a - a.convex_radius * near.normal + near.on_b + b.convex_radius * near.normal);
  return out.separation <= limits.margin;
}

SupportFeature feature_towards(const ConvexProxy& c, const Vec3& direction) {
  return support_feature(c.part, c.centre, c.axes, direction);
}

enum class CacheResult { kSeparated, kTouching, kUnknown };

// The face that the last normal stood on. What lies over it there is the patch; where the patch reaches as
// near as anything of the other does, the face's normal is the shortest way, and GJK has nothing to add.
CacheResult test_cached_axis(const ConvexProxy& a, const ConvexProxy& b, float margin,
                             const Vec3& last_normal, ManifoldReducer& out, float& clear) {
  constexpr float kTurned = 0.98F, kPrecision = 2e-4F;
  const float aligned_a = face_alignment(a.part, a.axes, -last_normal);
  const float aligned_b = face_alignment(b.part, b.axes, last_normal);
  if (std::max(aligned_a, aligned_b) < kTurned) return CacheResult::kUnknown;
  const bool from_a = aligned_a > aligned_b + 1e-3F;
  const SupportFeature face = from_a ? feature_towards(a, -last_normal) : feature_towards(b, last_normal);
  const ConvexProxy& other = from_a ? b : a;
  auto over = [&face](const Vec3& p) { return face.normal.dot(p - face.point[0]); };
  const float gap = over(other.support_with_radius(-face.normal));
  if (gap > margin) {
    clear = gap;
    return CacheResult::kSeparated;
  }
  if (gap < -a.convex_radius - b.convex_radius) return CacheResult::kUnknown;
  const SupportFeature patch = clip_to_face(feature_towards(other, -face.normal), face);
  const Vec3 normal = from_a ? Vec3(-face.normal) : face.normal;
  float nearest = std::numeric_limits<float>::max();
  for (int i = 0; i < patch.count; ++i) {
    const Vec3& p = patch.point[static_cast<std::size_t>(i)];
    const float height = over(p);
    nearest = std::min(nearest, height);
    if (height <= margin) out.add({p, normal, height, 0});
  }
  return nearest <= gap + kPrecision ? CacheResult::kTouching : CacheResult::kUnknown;
}

// Whether add_patch can find anything.
bool may_share_face(const ConvexProxy& a, const ConvexProxy& b, const Vec3& normal) {
  auto has_mantle = [](const ConvexProxy& c) { return !c.part.hull && c.part.shape.kind != ShapeKind::kBox; };
  return (has_mantle(a) && has_mantle(b)) || face_alignment(a.part, a.axes, -normal) > kAligned ||
         face_alignment(b.part, b.axes, normal) > kAligned;
}

// Returns how far apart the two are at least: the margin where they touch.
float collect_candidates(const ConvexProxy& a, const ConvexProxy& b, const SearchLimits& limits,
                         const CachedAxis& before, ManifoldReducer& out) {
  if (before.normal) {
    float clear = limits.margin;
    const CacheResult answer = test_cached_axis(a, b, limits.margin, *before.normal, out, clear);
    if (answer != CacheResult::kUnknown) return clear;
    out.clear();
  }
  ContactCandidate t;
  if (!find(a, b, limits, before, t)) return t.separation;
  if (may_share_face(a, b, t.normal))
    add_contact_patch(feature_towards(a, -t.normal), feature_towards(b, t.normal), t.normal, limits.margin, 0,
                      out);
  if (out.count() == 0) out.add({t.point, t.normal, t.separation, 0});
  return limits.margin;
}

float collide_parts(const ConvexProxy& a, const ConvexProxy& b, const SearchLimits& limits,
                    const CachedAxis& before, const Vec3& centre, std::vector<Contact>& out) {
  ManifoldReducer candidates;
  const float clear = collect_candidates(a, b, limits, before, candidates);
  if (clear > limits.margin) return clear;
  candidates.reduce([&](const ManifoldCandidate& c) {
    Contact& contact = out.emplace_back();
    contact.normal = c.normal;
    contact.anchor = c.point - centre;
    contact.separation = c.separation;
  });
  return clear;
}

// Of a box that is far larger than the other body only the part around it: GJK loses its precision on long
// thin simplices, and the corners far away tell nothing.
struct TrimmedShape {
  Shape shape;
  Vec3 centre;
  bool near = true;
};
bool is_much_larger(const PlacedShape& box, const PlacedShape& other) {
  return box.shape.kind == ShapeKind::kBox &&
         box.shape.half_extents.maxCoeff() > 6.0F * other.shape.bounding_radius;
}
TrimmedShape trim_to_overlap(const PlacedShape& box, const PlacedShape& other, float margin) {
  const Vec3 at = box.axes.transpose() * (other.centre - box.centre);
  const Vec3 around =
      Vec3::Constant(2.0F * other.shape.bounding_radius + std::min(margin, other.shape.bounding_radius));
  const Vec3 low = (at - around).cwiseMax(-box.shape.half_extents),
             high = (at + around).cwiseMin(box.shape.half_extents);
  TrimmedShape t{Shape{}, box.centre + box.axes * (0.5F * (low + high)), true};
  t.shape.kind = ShapeKind::kBox;
  t.shape.half_extents = 0.5F * (high - low);
  t.shape.bounding_radius = t.shape.half_extents.norm();
  t.shape.convex_radius = std::min(box.shape.convex_radius, 0.1F * t.shape.half_extents.minCoeff());
  t.near = t.shape.half_extents.minCoeff() > 0.0F;
  return t;
}

}  // namespace

float collide_convex(const PlacedShape& a, const PlacedShape& b, float margin, const Vec3* last_normal,
                     std::vector<Contact>& out, float horizon, SimplexCache* last) {
  const Vec3 reach_a = a.axes.cwiseAbs() * a.shape.half_extents,
             reach_b = b.axes.cwiseAbs() * b.shape.half_extents;
  const float apart = ((a.centre - b.centre).cwiseAbs() - reach_a - reach_b).maxCoeff();
  if (apart > margin + horizon) return apart;
  if (is_much_larger(a, b) || is_much_larger(b, a)) {
    const bool a_large = is_much_larger(a, b);
    const TrimmedShape t = a_large ? trim_to_overlap(a, b, margin) : trim_to_overlap(b, a, margin);
    if (!t.near) return margin;
    const std::size_t first = out.size();
    if (a_large)
      collide_convex({t.shape, t.centre, a.axes}, b, margin, last_normal, out);
    else
      collide_convex(a, {t.shape, t.centre, b.axes}, margin, last_normal, out);
    if (a_large)
      for (std::size_t i = first; i < out.size(); ++i) out[i].anchor += t.centre - a.centre;
    return margin;
  }
  const SearchLimits limits{margin, margin + horizon};
  // Of pieces that come in numbers nothing is remembered.
  const bool one_each = a.shape.hulls.size() <= 1 && b.shape.hulls.size() <= 1;
  const CachedAxis before{last_normal, one_each ? last : nullptr};
  float clear = limits.horizon;
  for_each_part(a.shape, [&](const ConvexPart& piece_a) {
    for_each_part(b.shape, [&](const ConvexPart& piece_b) {
      clear = std::min(clear, collide_parts({piece_a, a.centre, a.axes}, {piece_b, b.centre, b.axes}, limits,
                                            before, a.centre, out));
    });
  });
  return clear;
}

}  // namespace smartsurf::world

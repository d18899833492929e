#include "smartsurf/world/ConvexPair.h"

#include <algorithm>
#include <cmath>

#include "smartsurf/world/Feature.h"
#include "smartsurf/world/Gjk.h"

namespace smartsurf::world {
namespace {

using scene::ShapeKind;

struct Touching {
  Vec3 normal;  // from b to a
  float gap;
  Vec3 point;
};

// Directions in which the piece may be left on the shortest way, world frame.
template <class Try>
void for_ways_out(const Core& c, const Vec3& towards, Try attempt) {
  if (c.piece.hull) {
    for (const auto& face : c.piece.hull->piece->faces) attempt(Vec3(c.axes * face.normal));
    return;
  }
  const bool box = c.piece.shape.kind == ShapeKind::kBox;
  for (int axis = box ? 0 : 2; axis < 3; ++axis) {
    attempt(Vec3(c.axes.col(axis)));
    attempt(Vec3(-c.axes.col(axis)));
  }
  if (box) return;
  const Vec3 across = towards - c.axes.col(2) * c.axes.col(2).dot(towards);
  if (const float length = across.norm(); length > 1e-6F) attempt(Vec3(across / length));
}

// Cores that overlap: the way out among those of the faces of both.
Touching deepest(const Core& a, const Core& b) {
  Touching best{{0, 0, 1}, -std::numeric_limits<float>::max(), {}};
  auto attempt = [&](const Vec3& n) {
    const Vec3 on_a = a.farthest_outside(-n), on_b = b.farthest_outside(n);
    if (const float gap = n.dot(on_a - on_b); gap > best.gap) best = {n, gap, 0.5F * (on_a + on_b)};
  };
  const Vec3 apart = a.centre - b.centre;
  for_ways_out(b, apart, attempt);
  for_ways_out(a, -apart, [&](const Vec3& n) { attempt(-n); });
  if (const float length = apart.norm(); length > 1e-6F) attempt(apart / length);
  return best;
}

// How near two pieces are looked for: those within the margin touch, what is beyond it is told up to the
// horizon.
struct Limits {
  float margin, horizon;
};

// What is known of the two from before; either may be null.
struct Before {
  const Vec3* normal;
  NearestFeature* feature;
};

// Where they do not touch, of `out` only the gap is told.
bool find(const Core& a, const Core& b, const Limits& limits, const Before& before, Touching& out) {
  const NearestPoints near =
      nearest_points(a, b, limits.horizon + a.rounding + b.rounding,
                     before.normal ? *before.normal : Vec3(a.centre - b.centre), before.feature);
  if (!near.apart) {
    out = deepest(a, b);
    return true;
  }
  out.gap = near.distance - a.rounding - b.rounding;
  out.normal = near.normal;
  out.point = 0.5F * (near.on_a - a.rounding * near.normal + near.on_b + b.rounding * near.normal);
  return out.gap <= limits.margin;
}

Feature feature_towards(const Core& c, const Vec3& direction) {
  return feature_towards(c.piece, c.centre, c.axes, direction);
}

enum class Answer { kApart, kTouching, kUnknown };

// The face that the last normal stood on. What lies over it there is the patch; where the patch reaches as
// near as anything of the other does, the face's normal is the shortest way, and GJK has nothing to add.
Answer ask_last_face(const Core& a, const Core& b, float margin, const Vec3& last_normal, Candidates& out,
                     float& clear) {
  constexpr float kTurned = 0.98F, kPrecision = 2e-4F;
  const float aligned_a = flatness_towards(a.piece, a.axes, -last_normal);
  const float aligned_b = flatness_towards(b.piece, b.axes, last_normal);
  if (std::max(aligned_a, aligned_b) < kTurned) return Answer::kUnknown;
  const bool from_a = aligned_a > aligned_b + 1e-3F;
  const Feature face = from_a ? feature_towards(a, -last_normal) : feature_towards(b, last_normal);
  const Core& other = from_a ? b : a;
  auto over = [&face](const Vec3& p) { return face.normal.dot(p - face.point[0]); };
  const float gap = over(other.farthest_outside(-face.normal));
  if (gap > margin) {
    clear = gap;
    return Answer::kApart;
  }
  if (gap < -a.rounding - b.rounding) return Answer::kUnknown;
  const Feature patch = clipped(feature_towards(other, -face.normal), face);
  const Vec3 normal = from_a ? Vec3(-face.normal) : face.normal;
  float nearest = std::numeric_limits<float>::max();
  for (int i = 0; i < patch.count; ++i) {
    const Vec3& p = patch.point[static_cast<std::size_t>(i)];
    const float height = over(p);
    nearest = std::min(nearest, height);
    if (height <= margin) out.add({p, normal, height, 0});
  }
  return nearest <= gap + kPrecision ? Answer::kTouching : Answer::kUnknown;
}

// Whether add_patch can find anything.
bool may_share_patch(const Core& a, const Core& b, const Vec3& normal) {
  auto has_mantle = [](const Core& c) { return !c.piece.hull && c.piece.shape.kind != ShapeKind::kBox; };
  return (has_mantle(a) && has_mantle(b)) || flatness_towards(a.piece, a.axes, -normal) > kAligned ||
         flatness_towards(b.piece, b.axes, normal) > kAligned;
}

// Returns how far apart the two are at least: the margin where they touch.
float find_candidates(const Core& a, const Core& b, const Limits& limits, const Before& before,
                      Candidates& out) {
  if (before.normal) {
    float clear = limits.margin;
    const Answer answer = ask_last_face(a, b, limits.margin, *before.normal, out, clear);
    if (answer != Answer::kUnknown) return clear;
    out.clear();
  }
  Touching t;
  if (!find(a, b, limits, before, t)) return t.gap;
  if (may_share_patch(a, b, t.normal))
    add_patch(feature_towards(a, -t.normal), feature_towards(b, t.normal), t.normal, limits.margin, 0, out);
  if (out.count() == 0) out.add({t.point, t.normal, t.gap, 0});
  return limits.margin;
}

float touch_pieces(const Core& a, const Core& b, const Limits& limits, const Before& before,
                   const Vec3& centre, std::vector<Contact>& out) {
  Candidates candidates;
  const float clear = find_candidates(a, b, limits, before, candidates);
  if (clear > limits.margin) return clear;
  candidates.pick([&](const Candidate& c) {
    Contact& contact = out.emplace_back();
    contact.normal = c.normal;
    contact.anchor = c.point - centre;
    contact.separation = c.gap;
  });
  return clear;
}

// Of a box that is far larger than the other body only the part around it: GJK loses its precision on long
// thin simplices, and the corners far away tell nothing.
struct Trimmed {
  Shape shape;
  Vec3 centre;
  bool near = true;
};
bool far_larger(const Placed& box, const Placed& other) {
  return box.shape.kind == ShapeKind::kBox && box.shape.half.maxCoeff() > 6.0F * other.shape.reach;
}
Trimmed trimmed(const Placed& box, const Placed& other, float margin) {
  const Vec3 at = box.axes.transpose() * (other.centre - box.centre);
  const Vec3 around = Vec3::Constant(2.0F * other.shape.reach + std::min(margin, other.shape.reach));
  const Vec3 low = (at - around).cwiseMax(-box.shape.half), high = (at + around).cwiseMin(box.shape.half);
  Trimmed t{Shape{}, box.centre + box.axes * (0.5F * (low + high)), true};
  t.shape.kind = ShapeKind::kBox;
  t.shape.half = 0.5F * (high - low);
  t.shape.reach = t.shape.half.norm();
  t.shape.rounding = std::min(box.shape.rounding, 0.1F * t.shape.half.minCoeff());
  t.near = t.shape.half.minCoeff() > 0.0F;
  return t;
}

}  // namespace

float touch_convex(const Placed& a, const Placed& b, float margin, const Vec3* last_normal,
                   std::vector<Contact>& out, float horizon, NearestFeature* last) {
  const Vec3 reach_a = a.axes.cwiseAbs() * a.shape.half, reach_b = b.axes.cwiseAbs() * b.shape.half;
  const float apart = ((a.centre - b.centre).cwiseAbs() - reach_a - reach_b).maxCoeff();
  if (apart > margin + horizon) return apart;
  if (far_larger(a, b) || far_larger(b, a)) {
    const bool a_large = far_larger(a, b);
    const Trimmed t = a_large ? trimmed(a, b, margin) : trimmed(b, a, margin);
    if (!t.near) return margin;
    const std::size_t first = out.size();
    if (a_large)
      touch_convex({t.shape, t.centre, a.axes}, b, margin, last_normal, out);
    else
      touch_convex(a, {t.shape, t.centre, b.axes}, margin, last_normal, out);
    if (a_large)
      for (std::size_t i = first; i < out.size(); ++i) out[i].anchor += t.centre - a.centre;
    return margin;
  }
  const Limits limits{margin, margin + horizon};
  // Of pieces that come in numbers nothing is remembered.
  const bool one_each = a.shape.hulls.size() <= 1 && b.shape.hulls.size() <= 1;
  const Before before{last_normal, one_each ? last : nullptr};
  float clear = limits.horizon;
  for_pieces(a.shape, [&](const Piece& piece_a) {
    for_pieces(b.shape, [&](const Piece& piece_b) {
      clear = std::min(clear, touch_pieces({piece_a, a.centre, a.axes}, {piece_b, b.centre, b.axes}, limits,
                                           before, a.centre, out));
    });
  });
  return clear;
}

}  // namespace smartsurf::world

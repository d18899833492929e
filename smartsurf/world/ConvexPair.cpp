#include "smartsurf/world/ConvexPair.h"

#include <algorithm>
#include <cmath>

#include "smartsurf/world/Feature.h"
#include "smartsurf/world/Gjk.h"

namespace smartsurf::world {
namespace {

using scene::ShapeKind;

// A face this much in line with the normal takes part with its whole area.
constexpr float kAligned = 0.99F;

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

bool find(const Core& a, const Core& b, float margin, Touching& out) {
  const NearestPoints near = nearest_points(a, b);
  if (!near.apart) {
    out = deepest(a, b);
    return true;
  }
  out.gap = near.distance - a.rounding - b.rounding;
  out.normal = near.normal;
  out.point = 0.5F * (near.on_a - a.rounding * near.normal + near.on_b + b.rounding * near.normal);
  return out.gap <= margin;
}

// Edges that run side by side touch at both ends of what they share.
void add_parallel_edges(const Feature& a, const Feature& b, const Vec3& normal, float margin, Candidates& out) {
  const Vec3 along_a = a.point[1] - a.point[0], along_b = b.point[1] - b.point[0];
  const float length = along_a.norm(), length_b = along_b.norm();
  if (length < 1e-6F || length_b < 1e-6F || along_a.cross(along_b).norm() > 0.05F * length * length_b) return;
  const Vec3 u = along_a / length;
  const float s0 = u.dot(b.point[0] - a.point[0]), s1 = u.dot(b.point[1] - a.point[0]);
  const float low = std::max(0.0F, std::min(s0, s1)), high = std::min(length, std::max(s0, s1));
  if (low >= high) return;
  for (const float s : {low, high}) {
    const Vec3 on_a = a.point[0] + s * u;
    const Vec3 on_b = b.point[0] + along_b * ((s - s0) / (s1 - s0));
    const float gap = normal.dot(on_a - on_b);
    if (gap <= margin) out.add({0.5F * (on_a + on_b), normal, gap, 0});
  }
}

void touch_pieces(const Core& a, const Core& b, float margin, const Vec3& centre, std::vector<Contact>& out) {
  Touching t;
  if (!find(a, b, margin, t)) return;
  const Feature on_a = feature_towards(a.piece, a.centre, a.axes, -t.normal);
  const Feature on_b = feature_towards(b.piece, b.centre, b.axes, t.normal);
  const float aligned_a = on_a.flat() ? -on_a.normal.dot(t.normal) : 0.0F;
  const float aligned_b = on_b.flat() ? on_b.normal.dot(t.normal) : 0.0F;
  Candidates candidates;
  if (std::max(aligned_a, aligned_b) > kAligned) {
    // The smaller index wins a draw, or the choice would change from step to step.
    const bool from_a = aligned_a > aligned_b + 1e-3F;
    const Feature &face = from_a ? on_a : on_b, &other = from_a ? on_b : on_a;
    const Feature patch = clipped(other, face);
    const Vec3 normal = from_a ? Vec3(-face.normal) : face.normal;
    for (int i = 0; i < patch.count; ++i) {
      const Vec3& p = patch.point[static_cast<std::size_t>(i)];
      const float gap = face.normal.dot(p - face.point[0]);
      if (gap <= margin) candidates.add({p, normal, gap, 0});
    }
  } else if (on_a.count == 2 && on_b.count == 2) {
    add_parallel_edges(on_a, on_b, t.normal, margin, candidates);
  }
  if (candidates.count() == 0) candidates.add({t.point, t.normal, t.gap, 0});
  candidates.pick([&](const Candidate& c) {
    Contact& contact = out.emplace_back();
    contact.normal = c.normal;
    contact.arm = c.point - centre;
    contact.gap = c.gap;
  });
}

}  // namespace

void touch_convex(const Placed& a, const Placed& b, float margin, std::vector<Contact>& out) {
  const Vec3 reach_a = a.axes.cwiseAbs() * a.shape.half, reach_b = b.axes.cwiseAbs() * b.shape.half;
  if (((a.centre - b.centre).cwiseAbs() - reach_a - reach_b).maxCoeff() > margin) return;
  for_pieces(a.shape, [&](const Piece& piece_a) {
    for_pieces(b.shape, [&](const Piece& piece_b) {
      touch_pieces({piece_a, a.centre, a.axes}, {piece_b, b.centre, b.axes}, margin, a.centre, out);
    });
  });
}

}  // namespace smartsurf::world

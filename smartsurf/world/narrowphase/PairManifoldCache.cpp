#include "smartsurf/world/narrowphase/PairManifoldCache.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "smartsurf/world/narrowphase/ConvexPair.h"

namespace smartsurf::world {
namespace {

// How far two bodies may have moved against each other since they were looked at: as a share of the smaller
// one's reach, and in u. Whatever was farther apart then has not met yet.
constexpr float kWayShare = 0.03F, kMostWay = 0.06F;
// How far they may slide meanwhile where they touch, likewise. Their normals stay, so that what is off is of
// second order, a thousandth of a unit.
constexpr float kSlipShare = 0.015F, kMostSlip = 0.03F;
// Distances are told up to this much beyond what is needed at once, u.
constexpr float kHorizon = 0.2F;

// How two bodies stand to each other, in the axes of b.
struct RelativePose {
  Mat3 rotation;
  Vec3 translation;
  RelativePose(const BodyStore& bodies, std::size_t a, std::size_t b)
      : rotation(bodies.axes[b].transpose() * bodies.axes[a]),
        translation(bodies.axes[b].transpose() * (bodies.position[a] - bodies.position[b])) {}
};

float min_bounding_radius(const BodyStore& bodies, std::size_t a, std::size_t b) {
  return std::min(bodies.bounding_radius[a], bodies.bounding_radius[b]);
}
float max_travel(float reach) { return std::min(kMostWay, kWayShare * reach); }
float max_slip(float reach) { return std::min(kMostSlip, kSlipShare * reach); }

// No point of a has moved farther against b.
float relative_motion(const RelativePose& now, const PairManifoldCache::CachedManifold& before, float reach) {
  constexpr float kHalfRoot = 0.70710678F;
  return (now.translation - before.translation).norm() +
         kHalfRoot * reach * (now.rotation - before.rotation).norm();
}

// From b's point to a's, in the axes of b.
Vec3 separation_change(const RelativePose& now, const PairManifoldCache::CachedPoint& p) {
  return now.rotation * p.on_a + now.translation - p.on_b;
}

// Whether the bodies have slid farther than that at any of their points: each lay straight above its fellow
// when it was found.
bool slip(const RelativePose& now, const PairManifoldCache::CachedManifold& before, float most) {
  for (int k = 0; k < before.point_count; ++k) {
    const Vec3 open = separation_change(now, before.points[k]);
    const float gap = before.points[k].normal.dot(open);
    if (open.squaredNorm() - gap * gap > most * most) return true;
  }
  return false;
}

// Whether what is known of the two still tells their contacts with gaps up to `margin`.
bool is_valid(const BodyStore& bodies, const RelativePose& now,
              const PairManifoldCache::CachedManifold& before, float margin) {
  const auto a = static_cast<std::size_t>(before.a), b = static_cast<std::size_t>(before.b);
  const float way = relative_motion(now, before, bodies.bounding_radius[a]);
  if (way + margin > before.clearance) return false;
  if (way + margin <= before.min_separation) return true;
  const float reach = min_bounding_radius(bodies, a, b);
  return way <= max_travel(reach) && !slip(now, before, max_slip(reach));
}

// Looks at the two where they are now, and notes it.
void rebuild(const BodyStore& bodies, std::size_t a, std::size_t b, float margin, const Vec3* last_normal,
             SimplexCache& nearest, PairManifoldCache::CachedManifold& known,
             PairManifoldCache::ChunkCache& now) {
  thread_local std::vector<Contact> touching;
  touching.clear();
  known.clearance = collide_convex({*bodies.shape[a], bodies.position[a], bodies.axes[a]},
                                   {*bodies.shape[b], bodies.position[b], bodies.axes[b]},
                                   margin + max_travel(min_bounding_radius(bodies, a, b)), last_normal,
                                   touching, kHorizon, &nearest);
  known.point_count = static_cast<std::int32_t>(touching.size());
  known.min_separation = std::numeric_limits<float>::infinity();
  for (const Contact& c : touching) {
    known.min_separation = std::min(known.min_separation, c.separation);
    const Vec3 half = (0.5F * c.separation) * c.normal;
    const Vec3 from_b = bodies.position[a] - bodies.position[b] + c.anchor - half;
    now.points.push_back({bodies.axes[a].transpose() * (c.anchor + half), bodies.axes[b].transpose() * from_b,
                          bodies.axes[b].transpose() * c.normal});
  }
}

}  // namespace

void PairManifoldCache::swap_in(int chunk, ChunkCache& list) {
  const auto i = static_cast<std::size_t>(chunk);
  if (i >= previous_.size()) previous_.resize(i + 1);
  std::swap(previous_[i], list);
  list.manifolds.clear();
  list.points.clear();
  list.simplices.clear();
}

void PairManifoldCache::build_index(int bodies) {
  first_.assign(static_cast<std::size_t>(bodies), nullptr);
  for (ChunkCache& list : previous_)
    for (CachedManifold& k : list.manifolds) {
      const CachedManifold*& first = first_[static_cast<std::size_t>(k.a)];
      k.next = first;
      k.points = list.points.data() + k.first_point;
      k.simplex_cache = k.simplex < 0 ? nullptr : list.simplices.data() + k.simplex;
      first = &k;
    }
}

const PairManifoldCache::CachedManifold* PairManifoldCache::find(std::size_t a, std::size_t b) const {
  const CachedManifold* k = first_[a];
  while (k && k->b != static_cast<std::int32_t>(b)) k = k->next;
  return k;
}

void PairManifoldCache::collide(const BodyStore& bodies, std::size_t a, std::size_t b, float margin,
                                ChunkCache& now, std::vector<Contact>& out) const {
  const RelativePose placing(bodies, a, b);
  const CachedManifold* before = find(a, b);
  SimplexCache nearest;
  if (before && before->simplex_cache) nearest = *before->simplex_cache;
  CachedManifold& known = now.manifolds.emplace_back();
  const auto first = static_cast<std::int32_t>(now.points.size());
  if (before && is_valid(bodies, placing, *before, margin)) {
    known = *before;
    now.points.insert(now.points.end(), before->points, before->points + before->point_count);
  } else {
    known.a = static_cast<std::int32_t>(a);
    known.b = static_cast<std::int32_t>(b);
    known.rotation = placing.rotation;
    known.translation = placing.translation;
    const bool touched = before && before->point_count > 0;
    const Vec3 last_normal = touched ? Vec3(bodies.axes[b] * before->points->normal) : Vec3::Zero();
    rebuild(bodies, a, b, margin, touched ? &last_normal : nullptr, nearest, known, now);
  }
  known.first_point = first;
  known.simplex = nearest.count > 0 ? static_cast<std::int32_t>(now.simplices.size()) : -1;
  if (nearest.count > 0) now.simplices.push_back(nearest);
  for (int k = 0; k < known.point_count; ++k) {
    const CachedPoint& p = now.points[static_cast<std::size_t>(first + k)];
    const float gap = p.normal.dot(separation_change(placing, p));
    if (gap > margin) continue;
    Contact& c = out.emplace_back();
    c.normal = bodies.axes[b] * p.normal;
    c.anchor = bodies.axes[a] * p.on_a;
    c.separation = gap;
  }
}

}  // namespace smartsurf::world

#include "smartsurf/world/narrowphase/PairManifoldCache.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "smartsurf/world/narrowphase/ConvexPair.h"
#include "smartsurf/world/narrowphase/InternalEdges.h"

namespace smartsurf::world {
namespace {

// Greatest relative motion of two bodies for which a cached manifold stays valid: as a fraction of the
// smaller bounding radius, and in u. Features that were farther apart cannot touch yet.
constexpr float kPairTravelFraction = 0.03F, kMaxPairTravel = 0.06F;
// Greatest tangential motion at a cached point, likewise as a fraction and in u. The normals stay constant,
// so the error is of second order, about 1e-3 u.
constexpr float kPairSlipFraction = 0.015F, kMaxPairSlip = 0.03F;

// axes·v and axesᵀ·v. Eigen's products, which round alike, are calls; or they go through temporaries that are
// copied in other sizes than they were written: each copy waits for the stores. So would loops here.
Vec3 turn(const Mat3& axes, const Vec3& v) {
  const auto dot_row = [&](int i) { return axes(i, 0) * v[0] + (axes(i, 1) * v[1] + axes(i, 2) * v[2]); };
  return {dot_row(0), dot_row(1), dot_row(2)};
}
template <class Vector>
Vec3 turn_back(const Mat3& axes, const Vector& v) {
  const auto dot_column = [&](int i) { return axes(0, i) * v[0] + (axes(1, i) * v[1] + axes(2, i) * v[2]); };
  return {dot_column(0), dot_column(1), dot_column(2)};
}

// Pose of a relative to b, in the axes of b.
struct RelativePose {
  Mat3 rotation;
  Vec3 translation;
  RelativePose(const BodyStore& bodies, std::size_t a, std::size_t b)
      : translation(turn_back(bodies.axes[b], Vec3(bodies.origin(a) - bodies.origin(b)))) {
    for (int k = 0; k < 3; ++k) rotation.col(k) = turn_back(bodies.axes[b], bodies.axes[a].col(k));
  }
};

float min_bounding_radius(const BodyStore& bodies, std::size_t a, std::size_t b) {
  return std::min(bodies.bounding_radius[a], bodies.bounding_radius[b]);
}
float max_pair_travel(float bounding_radius) {
  return std::min(kMaxPairTravel, kPairTravelFraction * bounding_radius);
}
float max_pair_slip(float bounding_radius) {
  return std::min(kMaxPairSlip, kPairSlipFraction * bounding_radius);
}

// Upper bound of the motion of any point of a relative to b, u.
float relative_motion(const RelativePose& pose, const PairManifoldCache::CachedManifold& cached,
                      float bounding_radius) {
  constexpr float kHalfRoot = 0.70710678F;
  return (pose.translation - cached.translation).norm() +
         kHalfRoot * bounding_radius * (pose.rotation - cached.rotation).norm();
}

// The vector from the point on b to the point on a, in the axes of b.
Vec3 point_offset(const RelativePose& pose, const PairManifoldCache::CachedPoint& p) {
  return turn(pose.rotation, p.on_a) + pose.translation - p.on_b;
}

// True if the tangential motion exceeds `limit` at any cached point. Each pair of points was aligned along
// its normal when cached.
bool has_slipped(const RelativePose& pose, const PairManifoldCache::CachedManifold& cached, float limit) {
  for (int k = 0; k < cached.point_count; ++k) {
    const Vec3 offset = point_offset(pose, cached.points[k]);
    const float separation = cached.points[k].normal.dot(offset);
    if (offset.squaredNorm() - separation * separation > limit * limit) return true;
  }
  return false;
}

// True if the contact points at a normal follow b rather than a: they lie under a curved side, which rolls,
// or on the smaller body.
bool follows_b(const BodyStore& bodies, std::size_t a, std::size_t b, const Vec3& normal) {
  constexpr float kAlongAxis = 0.9F;
  const auto rolls = [&](std::size_t i) {
    return bodies.is_axisymmetric[i] && std::abs(bodies.axes[i].col(2).dot(normal)) < kAlongAxis;
  };
  if (const bool b_rolls = rolls(b); rolls(a) != b_rolls) return b_rolls;
  return bodies.bounding_radius[b] < bodies.bounding_radius[a];
}

// True if the cached manifold still yields all contacts with separations up to `margin`.
bool is_valid(const BodyStore& bodies, const RelativePose& pose,
              const PairManifoldCache::CachedManifold& cached, float margin) {
  const Index a = cached.a, b = cached.b;
  const float travel = relative_motion(pose, cached, bodies.bounding_radius[a]);
  if (travel + margin > cached.clearance) return false;
  if (travel + margin <= cached.min_separation) return true;
  const float min_radius = min_bounding_radius(bodies, a, b);
  return travel <= max_pair_travel(min_radius) && !has_slipped(pose, cached, max_pair_slip(min_radius));
}

// Between two of the points, on a.
float least_distance(std::span<const PairManifoldCache::CachedPoint> points) {
  float least_squared = std::numeric_limits<float>::infinity();
  for (std::size_t i = 0; i < points.size(); ++i)
    for (std::size_t k = 0; k < i; ++k)
      least_squared = std::min(least_squared, (points[i].on_a - points[k].on_a).squaredNorm());
  return std::sqrt(least_squared);
}

// Collides the manifold's bodies at their current poses and stores it.
void rebuild(const BodyStore& bodies, float margin, const Vec3* cached_normal, SimplexCache& simplex_cache,
             PairManifoldCache::CachedManifold& manifold, PairManifoldCache::ChunkCache& chunk_cache) {
  const std::size_t a = manifold.a, b = manifold.b;
  thread_local std::vector<Contact> contacts;
  contacts.clear();
  manifold.clearance = collide_convex({*bodies.shape[a], bodies.origin(a), bodies.axes[a]},
                                      {*bodies.shape[b], bodies.origin(b), bodies.axes[b]},
                                      margin + max_pair_travel(min_bounding_radius(bodies, a, b)),
                                      cached_normal, contacts, PairManifoldCache::kHorizon, &simplex_cache);
  // Parts whose contacts were left out may be the next to bear.
  if (correct_internal_edges({*bodies.shape[a], bodies.origin(a), bodies.axes[a]},
                             {*bodies.shape[b], bodies.origin(b), bodies.axes[b]}, contacts, 0))
    manifold.clearance = 0.0F;
  manifold.point_count = static_cast<std::int32_t>(contacts.size());
  manifold.min_separation = std::numeric_limits<float>::infinity();
  manifold.touching = 0;
  manifold.twist_friction_loss = contacts.empty() ? 0.0F : contacts[0].twist_friction_loss;
  const std::size_t first_point = chunk_cache.points.size();
  for (const Contact& c : contacts) {
    manifold.min_separation = std::min(manifold.min_separation, c.separation);
    const Vec3 half_separation = (0.5F * c.separation) * c.normal;
    const Vec3 from_b = bodies.origin(a) - bodies.origin(b) + c.anchor - half_separation;
    chunk_cache.points.push_back({bodies.axes[a].transpose() * (c.anchor + half_separation),
                                  bodies.axes[b].transpose() * from_b,
                                  bodies.axes[b].transpose() * c.normal});
  }
  manifold.gap = least_distance(std::span(chunk_cache.points).subspan(first_point));
}

}  // namespace

void PairManifoldCache::swap_in(int chunk, ChunkCache& chunk_cache) {
  if (chunk >= std::ssize(previous_)) previous_.resize(chunk + 1);
  chunk_cache.previous = {};
  if (previous_[chunk].manifolds.empty() && chunk_cache.manifolds.empty()) return;
  std::swap(previous_[chunk], chunk_cache);
  chunk_cache.previous = previous_[chunk].manifolds;
  chunk_cache.expected = 0;
  chunk_cache.manifolds.clear();
  chunk_cache.points.clear();
  chunk_cache.simplices.clear();
}

void PairManifoldCache::build_index(int bodies) {
  first_manifold_.clear(bodies);
  for (ChunkCache& chunk_cache : previous_)
    for (CachedManifold& k : chunk_cache.manifolds) {
      k.next = first_manifold_[k.a];
      k.points = chunk_cache.points.data() + k.first_point;
      k.simplex_cache = k.simplex < 0 ? nullptr : chunk_cache.simplices.data() + k.simplex;
      first_manifold_.set(k.a, &k);
    }
}

const PairManifoldCache::CachedManifold* PairManifoldCache::find(std::size_t a, std::size_t b,
                                                                 ChunkCache& chunk_cache) const {
  const auto index_a = static_cast<std::int32_t>(a), index_b = static_cast<std::int32_t>(b);
  const std::span<const CachedManifold> previous = chunk_cache.previous;
  if (chunk_cache.expected < previous.size()) {
    const CachedManifold& k = previous[chunk_cache.expected];
    if (k.a == index_a && k.b == index_b) return ++chunk_cache.expected, &k;
  }
  const CachedManifold* k = first_manifold_[a];
  while (k && k->b != index_b) k = k->next;
  const std::less<> before;
  if (k && !before(k, previous.data()) && before(k, previous.data() + previous.size()))
    chunk_cache.expected = k - previous.data() + 1;
  return k;
}

PairManifoldCache::Points PairManifoldCache::collide(const BodyStore& bodies, std::size_t a, std::size_t b,
                                                     float margin, ChunkCache& chunk_cache,
                                                     std::vector<Contact>& out) const {
  const RelativePose pose(bodies, a, b);
  const CachedManifold* cached = find(a, b, chunk_cache);
  const bool is_kept = cached && is_valid(bodies, pose, *cached, margin);
  const auto first_point = static_cast<std::int32_t>(chunk_cache.points.size());
  const auto next_simplex = static_cast<std::int32_t>(chunk_cache.simplices.size());
  if (is_kept) {
    chunk_cache.manifolds.push_back(*cached);
    chunk_cache.points.insert(chunk_cache.points.end(), cached->points, cached->points + cached->point_count);
    if (cached->simplex_cache) chunk_cache.simplices.push_back(*cached->simplex_cache);
  } else {
    chunk_cache.manifolds.emplace_back();
    CachedManifold& manifold = chunk_cache.manifolds.back();
    manifold.a = static_cast<std::int32_t>(a);
    manifold.b = static_cast<std::int32_t>(b);
    manifold.rotation = pose.rotation;
    manifold.translation = pose.translation;
    SimplexCache simplex_cache;
    if (cached && cached->simplex_cache) simplex_cache = *cached->simplex_cache;
    const bool was_touching = cached && cached->point_count > 0;
    const Vec3 cached_normal = was_touching ? Vec3(bodies.axes[b] * cached->points->normal) : Vec3::Zero();
    rebuild(bodies, margin, was_touching ? &cached_normal : nullptr, simplex_cache, manifold, chunk_cache);
    if (simplex_cache.count > 0) chunk_cache.simplices.push_back(simplex_cache);
  }
  CachedManifold& manifold = chunk_cache.manifolds.back();
  manifold.first_point = first_point;
  manifold.simplex = next_simplex < std::ssize(chunk_cache.simplices) ? next_simplex : -1;
  constexpr int kMaxKnown = 32;
  Points points{0, manifold.point_count <= kMaxKnown ? manifold.touching : 0, manifold.gap};
  // Not the copies: reading what was just written in other sizes waits for the stores.
  const CachedPoint* const cached_points = is_kept ? cached->points : chunk_cache.points.data() + first_point;
  const Vec3 origin_a = bodies.origin(a), origin_b = bodies.origin(b);
  for (int k = 0; k < manifold.point_count; ++k) {
    const CachedPoint& p = cached_points[k];
    const float separation = p.normal.dot(point_offset(pose, p));
    if (separation > margin) continue;
    Contact& c = out.emplace_back();
    c.normal = turn(bodies.axes[b], p.normal);
    if (follows_b(bodies, a, b, c.normal))
      c.anchor = origin_b + turn(bodies.axes[b], p.on_b) - origin_a;
    else
      c.anchor = turn(bodies.axes[a], p.on_a);
    c.separation = separation;
    c.twist_friction_loss = manifold.twist_friction_loss;
    points.touching |= std::uint32_t{1} << (k % kMaxKnown);
  }
  manifold.touching = points.touching;
  return points;
}

}  // namespace smartsurf::world

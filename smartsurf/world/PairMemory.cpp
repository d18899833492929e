#include "smartsurf/world/PairMemory.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "smartsurf/world/ConvexPair.h"

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
struct Placing {
  Mat3 turn;
  Vec3 apart;
  Placing(const BodyStore& bodies, std::size_t a, std::size_t b)
      : turn(bodies.axes[b].transpose() * bodies.axes[a]),
        apart(bodies.axes[b].transpose() * (bodies.position[a] - bodies.position[b])) {}
};

float smaller_reach(const BodyStore& bodies, std::size_t a, std::size_t b) {
  return std::min(bodies.bounding_radius[a], bodies.bounding_radius[b]);
}
float most_way(float reach) { return std::min(kMostWay, kWayShare * reach); }
float most_slip(float reach) { return std::min(kMostSlip, kSlipShare * reach); }

// No point of a has moved farther against b.
float moved(const Placing& now, const PairMemory::Known& before, float reach) {
  constexpr float kHalfRoot = 0.70710678F;
  return (now.apart - before.apart).norm() + kHalfRoot * reach * (now.turn - before.turn).norm();
}

// From b's point to a's, in the axes of b.
Vec3 opened(const Placing& now, const PairMemory::Point& p) { return now.turn * p.on_a + now.apart - p.on_b; }

// Whether the bodies have slid farther than that at any of their points: each lay straight above its fellow
// when it was found.
bool slid(const Placing& now, const PairMemory::Known& before, float most) {
  for (int k = 0; k < before.count; ++k) {
    const Vec3 open = opened(now, before.points[k]);
    const float gap = before.points[k].normal.dot(open);
    if (open.squaredNorm() - gap * gap > most * most) return true;
  }
  return false;
}

// Whether what is known of the two still tells their contacts with gaps up to `margin`.
bool holds(const BodyStore& bodies, const Placing& now, const PairMemory::Known& before, float margin) {
  const auto a = static_cast<std::size_t>(before.a), b = static_cast<std::size_t>(before.b);
  const float way = moved(now, before, bodies.bounding_radius[a]);
  if (way + margin > before.clear) return false;
  if (way + margin <= before.least_gap) return true;
  const float reach = smaller_reach(bodies, a, b);
  return way <= most_way(reach) && !slid(now, before, most_slip(reach));
}

// Looks at the two where they are now, and notes it.
void look(const BodyStore& bodies, std::size_t a, std::size_t b, float margin, const Vec3* last_normal,
          NearestFeature& nearest, PairMemory::Known& known, PairMemory::List& now) {
  thread_local std::vector<Contact> touching;
  touching.clear();
  known.clear =
      touch_convex({*bodies.shape[a], bodies.position[a], bodies.axes[a]},
                   {*bodies.shape[b], bodies.position[b], bodies.axes[b]},
                   margin + most_way(smaller_reach(bodies, a, b)), last_normal, touching, kHorizon, &nearest);
  known.count = static_cast<std::int32_t>(touching.size());
  known.least_gap = std::numeric_limits<float>::infinity();
  for (const Contact& c : touching) {
    known.least_gap = std::min(known.least_gap, c.separation);
    const Vec3 half = (0.5F * c.separation) * c.normal;
    const Vec3 from_b = bodies.position[a] - bodies.position[b] + c.anchor - half;
    now.points.push_back({bodies.axes[a].transpose() * (c.anchor + half), bodies.axes[b].transpose() * from_b,
                          bodies.axes[b].transpose() * c.normal});
  }
}

}  // namespace

void PairMemory::take(int chunk, List& list) {
  const auto i = static_cast<std::size_t>(chunk);
  if (i >= old_.size()) old_.resize(i + 1);
  std::swap(old_[i], list);
  list.pairs.clear();
  list.points.clear();
  list.features.clear();
}

void PairMemory::index(int bodies) {
  first_.assign(static_cast<std::size_t>(bodies), nullptr);
  for (List& list : old_)
    for (Known& k : list.pairs) {
      const Known*& first = first_[static_cast<std::size_t>(k.a)];
      k.next = first;
      k.points = list.points.data() + k.first;
      k.nearest = k.feature < 0 ? nullptr : list.features.data() + k.feature;
      first = &k;
    }
}

const PairMemory::Known* PairMemory::find(std::size_t a, std::size_t b) const {
  const Known* k = first_[a];
  while (k && k->b != static_cast<std::int32_t>(b)) k = k->next;
  return k;
}

void PairMemory::touch(const BodyStore& bodies, std::size_t a, std::size_t b, float margin, List& now,
                       std::vector<Contact>& out) const {
  const Placing placing(bodies, a, b);
  const Known* before = find(a, b);
  NearestFeature nearest;
  if (before && before->nearest) nearest = *before->nearest;
  Known& known = now.pairs.emplace_back();
  const auto first = static_cast<std::int32_t>(now.points.size());
  if (before && holds(bodies, placing, *before, margin)) {
    known = *before;
    now.points.insert(now.points.end(), before->points, before->points + before->count);
  } else {
    known.a = static_cast<std::int32_t>(a);
    known.b = static_cast<std::int32_t>(b);
    known.turn = placing.turn;
    known.apart = placing.apart;
    const bool touched = before && before->count > 0;
    const Vec3 last_normal = touched ? Vec3(bodies.axes[b] * before->points->normal) : Vec3::Zero();
    look(bodies, a, b, margin, touched ? &last_normal : nullptr, nearest, known, now);
  }
  known.first = first;
  known.feature = nearest.count > 0 ? static_cast<std::int32_t>(now.features.size()) : -1;
  if (nearest.count > 0) now.features.push_back(nearest);
  for (int k = 0; k < known.count; ++k) {
    const Point& p = now.points[static_cast<std::size_t>(first + k)];
    const float gap = p.normal.dot(opened(placing, p));
    if (gap > margin) continue;
    Contact& c = out.emplace_back();
    c.normal = bodies.axes[b] * p.normal;
    c.anchor = bodies.axes[a] * p.on_a;
    c.separation = gap;
  }
}

}  // namespace smartsurf::world

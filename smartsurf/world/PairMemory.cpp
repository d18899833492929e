#include "smartsurf/world/PairMemory.h"

#include <algorithm>
#include <cmath>

#include "smartsurf/world/ConvexPair.h"

namespace smartsurf::world {
namespace {

// How far bodies may move against each other and keep their points: as a share of the smaller one's reach,
// and in u. What is off then is of second order, a thousandth of that.
constexpr float kSlackShare = 0.015F, kMostSlack = 0.03F;
// Distances are told up to this much beyond what is needed at once, u.
constexpr float kHorizon = 0.2F;

float slack_of(const BodyStore& bodies, std::size_t a, std::size_t b) {
  return std::min(kMostSlack, kSlackShare * std::min(bodies.reach[a], bodies.reach[b]));
}

// How two bodies stand to each other, in the axes of b.
struct Placing {
  Mat3 turn;
  Vec3 apart;
  Placing(const BodyStore& bodies, std::size_t a, std::size_t b)
      : turn(bodies.axes[b].transpose() * bodies.axes[a]),
        apart(bodies.axes[b].transpose() * (bodies.position[a] - bodies.position[b])) {}
};

// No point of a has moved farther against b.
float moved(const Placing& now, const PairMemory::Known& before, float reach) {
  constexpr float kHalfRoot = 0.70710678F;
  return (now.apart - before.apart).norm() + kHalfRoot * reach * (now.turn - before.turn).norm();
}

// The contact at a point that the two still have; false where its gap is too wide.
bool contact_at(const BodyStore& bodies, std::size_t a, std::size_t b, const PairMemory::Point& p,
                float margin, Contact& out) {
  out.normal = bodies.axes[b] * p.normal;
  out.arm = bodies.axes[a] * p.on_a;
  out.gap = out.normal.dot(bodies.position[a] + out.arm - bodies.position[b] - bodies.axes[b] * p.on_b);
  return out.gap <= margin;
}

// Looks at the two where they are now, and notes it.
void look(const BodyStore& bodies, std::size_t a, std::size_t b, float margin, const Vec3* last_normal,
          NearestFeature& nearest, PairMemory::Known& known, PairMemory::List& now) {
  thread_local std::vector<Contact> touching;
  touching.clear();
  known.clear = touch_convex({*bodies.shape[a], bodies.position[a], bodies.axes[a]},
                             {*bodies.shape[b], bodies.position[b], bodies.axes[b]},
                             margin + slack_of(bodies, a, b), last_normal, touching, kHorizon, &nearest);
  known.count = static_cast<std::int32_t>(touching.size());
  for (const Contact& c : touching) {
    const Vec3 half = (0.5F * c.gap) * c.normal;
    const Vec3 from_b = bodies.position[a] - bodies.position[b] + c.arm - half;
    now.points.push_back({bodies.axes[a].transpose() * (c.arm + half), bodies.axes[b].transpose() * from_b,
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
  const float way = before ? moved(placing, *before, bodies.reach[a]) : 0.0F;
  const bool holds =
      before && way + margin <= before->clear && (before->count == 0 || way <= slack_of(bodies, a, b));
  if (holds) {
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
    Contact c;
    if (contact_at(bodies, a, b, now.points[static_cast<std::size_t>(first + k)], margin, c))
      out.push_back(c);
  }
}

}  // namespace smartsurf::world

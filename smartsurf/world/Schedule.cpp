#include "smartsurf/world/Schedule.h"

#include <algorithm>
#include <bit>

namespace smartsurf::world {
namespace {

constexpr int kColours = 64;  // one more for what finds none
constexpr int kCounts = 16;   // manifolds are packed by their number of points, as far as that many

// More points first: an octet has as many as its first lane.
int by_count(const Manifold& m) { return kCounts - std::min(m.count, kCounts); }

}  // namespace

void Schedule::build(const BodyStore& bodies, const ContactList& pairs, const ContactList& world) {
  order_.resize(pairs.manifolds.size() + world.manifolds.size());
  octet_.clear();
  start_.clear();
  colours_.clear();
  points_ = 0;
  colour_pairs(bodies, pairs);
  sort_pairs(bodies, pairs);
  sort_world(bodies, world);
}

void Schedule::colour_pairs(const BodyStore& bodies, const ContactList& pairs) {
  used_.assign(static_cast<std::size_t>(bodies.size()), 0);
  colour_.resize(pairs.manifolds.size());
  for (std::size_t i = 0; i < pairs.manifolds.size(); ++i) {
    std::uint64_t& a = used_[static_cast<std::size_t>(pairs.manifolds[i].a)];
    std::uint64_t& b = used_[static_cast<std::size_t>(pairs.manifolds[i].b)];
    const int colour = std::countr_one(a | b);
    colour_[i] = static_cast<std::uint8_t>(colour);
    if (colour == kColours) continue;
    a |= std::uint64_t{1} << colour;
    b |= std::uint64_t{1} << colour;
  }
}

void Schedule::sort_by_key(int keys, int base) {
  first_of_key_.assign(static_cast<std::size_t>(keys) + 1, 0);
  for (const std::int32_t key : key_) ++first_of_key_[static_cast<std::size_t>(key) + 1];
  for (std::size_t k = 1; k < first_of_key_.size(); ++k) first_of_key_[k] += first_of_key_[k - 1];
  next_of_key_.assign(first_of_key_.begin(), first_of_key_.end());
  for (std::size_t i = 0; i < key_.size(); ++i)
    order_[static_cast<std::size_t>(base + next_of_key_[static_cast<std::size_t>(key_[i])]++)] =
        static_cast<std::int32_t>(i);
}

void Schedule::sort_pairs(const BodyStore& bodies, const ContactList& pairs) {
  constexpr int kKeys = (kColours + 1) * 2 * kCounts;
  key_.resize(pairs.manifolds.size());
  for (std::size_t i = 0; i < key_.size(); ++i) {
    const Manifold& m = pairs.manifolds[i];
    const bool any =
        !bodies.round[static_cast<std::size_t>(m.a)] || !bodies.round[static_cast<std::size_t>(m.b)];
    key_[i] = (colour_[i] * 2 + (any ? 1 : 0)) * kCounts + by_count(m);
  }
  sort_by_key(kKeys, 0);
  for (int c = 0; c <= kColours; ++c) {
    auto first = [&](int kind) { return first_of_key_[static_cast<std::size_t>((c * 2 + kind) * kCounts)]; };
    if (first(0) == first(2)) continue;
    const bool in_order = c == kColours;
    Colour colour;
    colour.in_order = in_order;
    colour.round = pack(pairs, first(0), first(1), in_order ? 1 : kLanes);
    colour.any = pack(pairs, first(1), first(2), in_order ? 1 : kLanes);
    colours_.push_back(colour);
  }
}

void Schedule::sort_world(const BodyStore& bodies, const ContactList& world) {
  constexpr int kKeys = 2 * kCounts;
  key_.resize(world.manifolds.size());
  for (std::size_t i = 0; i < key_.size(); ++i) {
    const Manifold& m = world.manifolds[i];
    key_[i] = (bodies.round[static_cast<std::size_t>(m.a)] ? 0 : 1) * kCounts + by_count(m);
  }
  const auto base = static_cast<int>(order_.size() - world.manifolds.size());
  sort_by_key(kKeys, base);
  const int middle = base + first_of_key_[kCounts], end = base + first_of_key_[kKeys];
  round_world_ = pack(world, base, middle, kLanes);
  any_world_ = pack(world, middle, end, kLanes);
}

Range Schedule::share(const OctetRun& run, int member, int members) const {
  if (run.count == 0) return {run.first, run.first};
  const auto begin = octet_.begin() + run.first, end = begin + run.count;
  const long before = begin->first, points = (end - 1)->first + (end - 1)->points - before;
  auto at = [&](int share) {
    const long from = before + points * share / members;
    const auto first = std::partition_point(begin, end, [from](const Octet& o) { return o.first < from; });
    return static_cast<int>(first - octet_.begin());
  };
  return {at(member), member + 1 == members ? run.first + run.count : at(member + 1)};
}

OctetRun Schedule::pack(const ContactList& list, int begin, int end, int lanes) {
  OctetRun run{octets(), 0};
  for (int at = begin; at < end; at += lanes, ++run.count) {
    Octet& o = octet_.emplace_back();
    start_.push_back(at);
    o.count = std::min(lanes, end - at);
    for (int lane = 0; lane < kLanes; ++lane) {
      // Lanes not in use look at the first one's bodies.
      const int i = order_[static_cast<std::size_t>(at + (lane < o.count ? lane : 0))];
      const Manifold& m = list.manifolds[static_cast<std::size_t>(i)];
      o.a[lane] = m.a;
      o.b[lane] = m.b;
      o.points = std::max(o.points, m.count);
    }
    o.first = points_;
    points_ += o.points;
  }
  return run;
}

}  // namespace smartsurf::world

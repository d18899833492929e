#include "smartsurf/world/Schedule.h"

#include <algorithm>
#include <bit>

namespace smartsurf::world {

void Schedule::build(const BodyStore& bodies, const ContactList& pairs, const SlabRuns& pair_runs,
                     const ContactList& world, const SlabRuns& world_runs, Range slabs,
                     const Member& member) {
  member.alone([&] {
    colour_pairs(bodies, pairs);
    key_.resize(pairs.manifolds.size() + world.manifolds.size());
    order_.resize(key_.size());
    place_.resize(static_cast<std::size_t>(member.members));
    share_.resize(place_.size());
  });
  Places& place = place_[static_cast<std::size_t>(member.index)];
  std::fill_n(place.begin(), keys(), 0);
  count_keys(bodies, pairs, pair_runs, slabs, true, place);
  count_keys(bodies, world, world_runs, slabs, false, place);
  member.alone([&] { find_places(member.members); });
  Places next;
  std::copy_n(place.begin(), keys(), next.begin());
  sort(pair_runs, slabs, 0, next);
  sort(world_runs, slabs, pairs.manifolds.size(), next);
  member.alone([&] { pack(pairs, world); });
  list_share(member);
}

void Schedule::colour_pairs(const BodyStore& bodies, const ContactList& pairs) {
  used_.assign(static_cast<std::size_t>(bodies.size()), 0);
  colour_.resize(pairs.manifolds.size());
  int last = -1;
  for (std::size_t i = 0; i < pairs.manifolds.size(); ++i) {
    std::uint64_t& a = used_[static_cast<std::size_t>(pairs.manifolds[i].a)];
    std::uint64_t& b = used_[static_cast<std::size_t>(pairs.manifolds[i].b)];
    const int colour = std::countr_one(a | b);
    colour_[i] = static_cast<std::uint8_t>(colour);
    last = std::max(last, colour);
    if (colour == kColours) continue;
    a |= std::uint64_t{1} << colour;
    b |= std::uint64_t{1} << colour;
  }
  used_colours_ = last + 1;
}

// ---- a counting sort, to which each member brings the manifolds of its slabs

void Schedule::count_keys(const BodyStore& bodies, const ContactList& list, const SlabRuns& runs, Range slabs,
                          bool pair, Places& count) {
  const std::size_t before = pair ? 0 : key_.size() - list.manifolds.size();
  for (const Range& run : runs.of(slabs))
    for (auto i = static_cast<std::size_t>(run.begin); i < static_cast<std::size_t>(run.end); ++i) {
      const Manifold& m = list.manifolds[i];
      const bool round = bodies.round[static_cast<std::size_t>(m.a)] &&
                         (!pair || bodies.round[static_cast<std::size_t>(m.b)]);
      const int group = (pair ? colour_[i] : used_colours_) * 2 + (round ? 0 : 1);
      const int key = group * kCounts + kCounts - std::min(m.count, kCounts);
      key_[before + i] = static_cast<std::int16_t>(key);
      ++count[static_cast<std::size_t>(key)];
    }
}

void Schedule::find_places(int members) {
  std::int32_t at = 0;
  for (std::size_t key = 0; key < keys(); ++key) {
    first_of_key_[key] = at;
    for (int m = 0; m < members; ++m) {
      std::int32_t& place = place_[static_cast<std::size_t>(m)][key];
      const std::int32_t count = place;
      place = at;
      at += count;
    }
  }
  first_of_key_[keys()] = at;
}

void Schedule::sort(const SlabRuns& runs, Range slabs, std::size_t first_key, Places& next) {
  for (const Range& run : runs.of(slabs))
    for (int i = run.begin; i < run.end; ++i) {
      const auto key = static_cast<std::size_t>(key_[first_key + static_cast<std::size_t>(i)]);
      order_[static_cast<std::size_t>(next[key]++)] = i;
    }
}

// ---- octets

void Schedule::pack(const ContactList& pairs, const ContactList& world) {
  start_.clear();
  first_point_.assign(1, 0);
  colours_.clear();
  for (int c = 0; c < used_colours_; ++c) {
    const bool in_order = c == kColours;
    const int lanes = in_order ? 1 : kLanes;
    Colour colour{pack(kRoundPair, 2 * c, lanes, pairs), pack(kAnyPair, 2 * c + 1, lanes, pairs), in_order};
    if (colour.round.count + colour.any.count > 0) colours_.push_back(colour);
  }
  round_world_ = pack(kRoundWorld, 2 * used_colours_, kLanes, world);
  any_world_ = pack(kAnyWorld, 2 * used_colours_ + 1, kLanes, world);
  octet_.resize(start_.size());
  start_.push_back(first_of_key_[keys()]);
}

OctetRun Schedule::pack(ContactKind kind, int group, int lanes, const ContactList& list) {
  auto key = static_cast<std::size_t>(group) * kCounts;
  const std::size_t first_key = key;
  const int end = first_of_key_[key + kCounts];
  OctetRun run{kind, static_cast<int>(start_.size()), 0};
  for (int at = first_of_key_[key]; at < end; at += lanes, ++run.count) {
    while (first_of_key_[key + 1] <= at) ++key;
    // As many points as the first lane has; of those with very many the first may not have most.
    int points = kCounts - static_cast<int>(key - first_key);
    for (int k = at; key == first_key && k < std::min(at + lanes, end); ++k)
      points = std::max(points,
                        list.manifolds[static_cast<std::size_t>(order_[static_cast<std::size_t>(k)])].count);
    start_.push_back(at);
    first_point_.push_back(first_point_.back() + points);
  }
  return run;
}

Octet& Schedule::clear_octet(int index) {
  const auto i = static_cast<std::size_t>(index);
  Octet& o = octet_[i];
  o.first = first_point_[i];
  o.points = first_point_[i + 1] - o.first;
  o.count = start_[i + 1] - start_[i];
  o.rolls = o.limited = false;
  return o;
}

// ---- who solves what

void Schedule::list_share(const Member& member) {
  Share& share = share_[static_cast<std::size_t>(member.index)];
  share.clear();
  for (const Colour& c : colours_) {
    for (const OctetRun& run : {c.round, c.any}) {
      if (!c.in_order)
        add_share(run, member);
      else if (member.leads())
        share.add(run);
    }
    share.end_colour();
  }
  add_share(round_world_, member);
  add_share(any_world_, member);
  share.end_colour();
}

// Of each number of points the member's manifolds follow each other, and with them its octets.
void Schedule::add_share(const OctetRun& run, const Member& member) {
  if (run.count == 0) return;
  Share& mine = share_[static_cast<std::size_t>(member.index)];
  const int begin = start_[static_cast<std::size_t>(run.first)];
  const auto end = first_of_key_.begin() + static_cast<std::ptrdiff_t>(keys()) + 1;
  const auto group = static_cast<std::size_t>(std::upper_bound(first_of_key_.begin(), end, begin) -
                                              first_of_key_.begin() - 1) /
                     kCounts;
  auto octets_to = [&](int place) { return run.first + (place - begin + kLanes - 1) / kLanes; };
  for (std::size_t key = group * kCounts; key < (group + 1) * kCounts; ++key) {
    const auto next = static_cast<std::size_t>(member.index) + 1;
    const int from = place_[next - 1][key];
    const int to = next < place_.size() ? place_[next][key] : first_of_key_[key + 1];
    mine.add({run.kind, octets_to(from), octets_to(to) - octets_to(from)});
  }
}

}  // namespace smartsurf::world

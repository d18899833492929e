#include "smartsurf/world/solver/ConstraintGraph.h"

#include <algorithm>
#include <bit>
#include <utility>

namespace smartsurf::world {

void ConstraintGraph::build(const BodyStore& bodies, const ContactList& pair_contacts,
                            const SlabRanges& pair_ranges, const ContactList& static_contacts,
                            const SlabRanges& static_ranges, IndexRange slabs, const Member& member) {
  member.single([&] {
    colour_pairs(bodies, pair_contacts);
    manifold_key_.resize(pair_contacts.manifolds.size() + static_contacts.manifolds.size());
    sorted_manifolds_.resize(manifold_key_.size());
    key_offsets_.resize(member.member_count);
    member_batches_.resize(key_offsets_.size());
  });
  KeyOffsets& own_offsets = key_offsets_[member.index];
  std::fill_n(own_offsets.begin(), key_count(), 0);
  count_keys(bodies, pair_contacts, pair_ranges, slabs, true, own_offsets);
  count_keys(bodies, static_contacts, static_ranges, slabs, false, own_offsets);
  member.single([&] { compute_key_offsets(); });
  sort_manifolds(pair_ranges, slabs, 0, own_offsets);
  sort_manifolds(static_ranges, slabs, pair_contacts.manifolds.size(), own_offsets);
  member.single([&] { pack_batches(pair_contacts, static_contacts); });
  collect_own_batches(member);
}

// Greedy colouring in list order: the lowest colour that neither body has yet, or kMaxColours for overflow.
void ConstraintGraph::colour_pairs(const BodyStore& bodies, const ContactList& pair_contacts) {
  const bool are_few = 2 * pair_contacts.manifolds.size() < bodies.id.size();
  if (are_few && body_colours_.size() >= bodies.id.size())
    for (const Manifold& m : pair_contacts.manifolds) body_colours_[m.a] = body_colours_[m.b] = 0;
  else
    body_colours_.assign(bodies.size(), 0);
  manifold_colour_.resize(pair_contacts.manifolds.size());
  int last = -1;
  for (std::size_t i = 0; i < pair_contacts.manifolds.size(); ++i) {
    std::uint64_t& a = body_colours_[pair_contacts.manifolds[i].a];
    std::uint64_t& b = body_colours_[pair_contacts.manifolds[i].b];
    const int colour = std::countr_one(a | b);
    manifold_colour_[i] = static_cast<std::uint8_t>(colour);
    last = std::max(last, colour);
    if (colour == kMaxColours) continue;
    a |= std::uint64_t{1} << colour;
    b |= std::uint64_t{1} << colour;
  }
  colour_count_ = last + 1;
}

// ---- parallel counting sort; each member sorts the manifolds of its slabs

void ConstraintGraph::count_keys(const BodyStore& bodies, const ContactList& list, const SlabRanges& ranges,
                                 IndexRange slabs, bool pair, KeyOffsets& count) {
  const std::size_t key_base = pair ? 0 : manifold_key_.size() - list.manifolds.size();
  for (const IndexRange& run : ranges.of(slabs))
    for (int i = run.begin; i < run.end; ++i) {
      const Manifold& m = list.manifolds[i];
      const bool all_spheres = bodies.is_sphere[m.a] && (!pair || bodies.is_sphere[m.b]);
      const int group = (pair ? manifold_colour_[i] : colour_count_) * 2 + (all_spheres ? 0 : 1);
      const int key = group * kPointCountBuckets + kPointCountBuckets - std::min(m.count, kPointCountBuckets);
      manifold_key_[key_base + i] = static_cast<std::int16_t>(key);
      ++count[key];
    }
}

void ConstraintGraph::compute_key_offsets() {
  std::int32_t offset = 0;
  if (key_offsets_.size() == 1) {  // small worlds spend their steps on such loops
    KeyOffsets& offsets = key_offsets_.front();
    for (int group = 0; group < key_count(); group += kPointCountBuckets) {
      const auto counts = std::span(offsets).subspan(group, kPointCountBuckets);
      std::int32_t any = 0;
      for (const std::int32_t count : counts) any |= count;
      first_of_key_[group] = offset;
      for (int key = group; any != 0 && key < group + kPointCountBuckets; ++key) {
        first_of_key_[key] = offset;
        offset += std::exchange(offsets[key], offset);
      }
    }
    first_of_key_[key_count()] = offset;
    return;
  }
  for (int key = 0; key < key_count(); ++key) {
    first_of_key_[key] = offset;
    for (KeyOffsets& offsets : key_offsets_) offset += std::exchange(offsets[key], offset);
  }
  first_of_key_[key_count()] = offset;
}

void ConstraintGraph::sort_manifolds(const SlabRanges& ranges, IndexRange slabs, std::size_t first_key,
                                     KeyOffsets& next_slot) {
  for (const IndexRange& run : ranges.of(slabs))
    for (int i = run.begin; i < run.end; ++i) {
      const std::int16_t key = manifold_key_[first_key + i];
      sorted_manifolds_[next_slot[key]++] = i;
    }
}

// ---- batches

void ConstraintGraph::pack_batches(const ContactList& pair_contacts, const ContactList& static_contacts) {
  batch_start_.clear();
  first_point_.assign(1, 0);
  colours_.clear();
  for (int c = 0; c < colour_count_; ++c) {
    const bool is_overflow = c == kMaxColours;
    const int lanes = is_overflow ? 1 : kLanes;
    Colour colour{pack_batches(kSpherePair, 2 * c, lanes, pair_contacts),
                  pack_batches(kGeneralPair, 2 * c + 1, lanes, pair_contacts), is_overflow};
    if (colour.spheres.count + colour.general.count > 0) colours_.push_back(colour);
  }
  sphere_static_ = pack_batches(kSphereStatic, 2 * colour_count_, kLanes, static_contacts);
  general_static_ = pack_batches(kGeneralStatic, 2 * colour_count_ + 1, kLanes, static_contacts);
  batch_.resize(batch_start_.size());
  batch_start_.push_back(first_of_key_[key_count()]);
}

BatchRange ConstraintGraph::pack_batches(ContactKind kind, int group, int lanes, const ContactList& list) {
  int key = group * kPointCountBuckets;
  const int first_key = key;
  const int end = first_of_key_[key + kPointCountBuckets];
  BatchRange run{kind, static_cast<int>(batch_start_.size()), 0};
  for (int at = first_of_key_[key]; at < end; at += lanes, ++run.count) {
    while (first_of_key_[key + 1] <= at) ++key;
    // Point counts descend, so the first lane has most points; except in the first bucket, which holds all
    // manifolds with kPointCountBuckets points or more.
    int points = kPointCountBuckets - (key - first_key);
    for (int k = at; key == first_key && k < std::min(at + lanes, end); ++k)
      points = std::max(points, list.manifolds[sorted_manifolds_[k]].count);
    batch_start_.push_back(at);
    first_point_.push_back(first_point_.back() + points);
  }
  return run;
}

ContactBatch& ConstraintGraph::reset_batch(int index) {
  ContactBatch& o = batch_[index];
  o.first_point = first_point_[index];
  o.point_count = first_point_[index + 1] - o.first_point;
  o.lane_count = lane_count(index);
  o.has_friction = o.has_rolling_friction = o.has_face_patch = false;
  o.has_impulse_limit = o.has_surface_spin = false;
  return o;
}

// ---- assignment of batches to members

void ConstraintGraph::collect_own_batches(const Member& member) {
  MemberBatchRanges& own = member_batches_[member.index];
  own.clear();
  for (const Colour& c : colours_) {
    for (const BatchRange& run : {c.spheres, c.general}) {
      if (!c.is_overflow)
        append_own_batches(run, member);
      else if (member.is_caller())
        own.append(run);
    }
    own.end_colour();
  }
  append_own_batches(sphere_static_, member);
  append_own_batches(general_static_, member);
  own.end_colour();
}

// An even share of the batches of each key, in which those of a member's slabs are contiguous and those of
// its neighbours next to them. What is left over goes to one member after the other.
void ConstraintGraph::append_own_batches(const BatchRange& run, const Member& member) {
  if (run.count == 0) return;
  MemberBatchRanges& own = member_batches_[member.index];
  if (member.member_count == 1) return own.append(run);
  const int begin = batch_start_[run.first];
  const auto end = first_of_key_.begin() + key_count() + 1;
  const auto key_of_run = std::upper_bound(first_of_key_.begin(), end, begin) - first_of_key_.begin() - 1;
  const auto group = key_of_run / kPointCountBuckets;
  auto batches_before = [&](int position) { return run.first + (position - begin + kLanes - 1) / kLanes; };
  for (auto key = group * kPointCountBuckets; key < (group + 1) * kPointCountBuckets; ++key) {
    const int first = batches_before(first_of_key_[key]),
              count = batches_before(first_of_key_[key + 1]) - first;
    const auto share_before = [&](int members) {
      return static_cast<int>((static_cast<long>(count) * members + first % member.member_count) /
                              member.member_count);
    };
    const int from = share_before(member.index), to = share_before(member.index + 1);
    own.append({run.kind, first + from, to - from});
  }
}

}  // namespace smartsurf::world

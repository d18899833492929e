#include "smartsurf/world/solver/ConstraintGraph.h"

#include <algorithm>
#include <bit>
#include <utility>

namespace smartsurf::world {

void ConstraintGraph::build(const Input& in, IndexRange slabs, const Member& member) {
  member.single([&] { begin(in, member.member_count); });
  KeyOffsets& own_offsets = key_offsets_[member.index];
  std::fill_n(own_offsets.begin(), kPointCountBuckets * group_count(), 0);
  count_keys(in.bodies, in.pair_contacts, in.pair_ranges, slabs, true, own_offsets);
  count_keys(in.bodies, in.static_contacts, in.static_ranges, slabs, false, own_offsets);
  member.single([&] { compute_key_offsets(); });
  sort_manifolds(in.pair_ranges, slabs, 0, own_offsets);
  sort_manifolds(in.static_ranges, slabs, first_static_, own_offsets);
}

void ConstraintGraph::begin(const Input& in, int member_count) {
  colour_pairs(in);
  first_static_ = in.pair_contacts.manifolds.size();
  manifold_key_.resize(first_static_ + in.static_contacts.manifolds.size());
  sorted_manifolds_.resize(manifold_key_.size());
  key_offsets_.resize(member_count);
  member_batches_.resize(member_count);
}

// Greedy colouring in list order: the lowest colour that neither body has yet, or kMaxColours for overflow.
void ConstraintGraph::colour_pairs(const Input& in) {
  const std::vector<Manifold>& manifolds = in.pair_contacts.manifolds;
  const std::size_t bodies = in.bodies.id.size();
  if (2 * manifolds.size() < bodies && body_colours_.size() >= bodies)
    for (const Manifold& m : manifolds) body_colours_[m.a] = body_colours_[m.b] = 0;
  else
    body_colours_.assign(bodies, 0);
  manifold_colour_.resize(manifolds.size());
  int last = -1;
  for (std::size_t i = 0; i < manifolds.size(); ++i) {
    std::uint64_t &a = body_colours_[manifolds[i].a], &b = body_colours_[manifolds[i].b];
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
  const std::size_t key_base = pair ? 0 : first_static_;
  const IndexRange own = ranges.of(slabs);
  for (int i = own.begin; i < own.end; ++i) {
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
  const auto assign = [&offset](std::int32_t& count) { offset += std::exchange(count, offset); };
  for (KeyOffsets& own : key_offsets_)
    for (int group = 0; group < group_count(); ++group) {
      const int first_key = group * kPointCountBuckets, end_key = first_key + kPointCountBuckets;
      if (is_overflow(group)) {
        for (int key = first_key; &own == &key_offsets_.back() && key < end_key; ++key)
          for (KeyOffsets& offsets : key_offsets_) assign(offsets[key]);
        continue;
      }
      std::int32_t any = 0;
      for (int key = first_key; key < end_key; ++key) any |= own[key];
      if (any == 0) continue;  // small worlds spend their steps on such loops
      for (int key = first_key; key < end_key; ++key) assign(own[key]);
    }
}

void ConstraintGraph::sort_manifolds(const SlabRanges& ranges, IndexRange slabs, std::size_t first_key,
                                     KeyOffsets& next_slot) {
  const IndexRange own = ranges.of(slabs);
  for (int i = own.begin; i < own.end; ++i) sorted_manifolds_[next_slot[manifold_key_[first_key + i]]++] = i;
}

// ---- batches

void ConstraintGraph::pack_batches(const Input& in) {
  batch_start_.assign(1, 0);
  first_point_.assign(1, 0);
  for (std::size_t m = 0; m < member_batches_.size(); ++m) {
    member_batches_[m].clear();
    for (int c = 0; c < colour_count_; ++c) {
      pack_group(kSpherePair, 2 * c, m, in.pair_contacts);
      pack_group(kGeneralPair, 2 * c + 1, m, in.pair_contacts);
      member_batches_[m].end_colour();
    }
    pack_group(kSphereStatic, 2 * colour_count_, m, in.static_contacts);
    pack_group(kGeneralStatic, 2 * colour_count_ + 1, m, in.static_contacts);
    member_batches_[m].end_colour();
  }
  batch_.resize(batch_start_.size() - 1);
}

void ConstraintGraph::pack_group(ContactKind kind, int group, std::size_t member, const ContactList& list) {
  const bool in_order = is_overflow(group);
  if (in_order && member + 1 < member_batches_.size()) return;
  const int first = static_cast<int>(batch_start_.size()) - 1;
  member_batches_[member].append(
      {kind, first, pack_lanes(group, in_order ? 1 : kLanes, key_offsets_[member], list)});
}

// Packs the manifolds up to the end of the group's last key. Returns the number of batches.
int ConstraintGraph::pack_lanes(int group, int lanes, const KeyOffsets& ends, const ContactList& list) {
  const int first_key = group * kPointCountBuckets, end = ends[first_key + kPointCountBuckets - 1];
  int count = 0;
  for (int key = first_key; batch_start_.back() < end; ++count) {
    const int begin = batch_start_.back(), end_of_batch = std::min(begin + lanes, end);
    while (ends[key] <= begin) ++key;
    // Point counts descend, so the first lane has most points; except in the first bucket, which holds all
    // manifolds with kPointCountBuckets points or more.
    int points = kPointCountBuckets - (key - first_key);
    for (int k = begin; key == first_key && k < end_of_batch; ++k)
      points = std::max(points, list.manifolds[sorted_manifolds_[k]].count);
    batch_start_.push_back(end_of_batch);
    first_point_.push_back(first_point_.back() + points);
  }
  return count;
}

ContactBatch& ConstraintGraph::reset_batch(int index) {
  ContactBatch& o = batch_[index];
  o.first_point = first_point_[index];
  o.point_count = first_point_[index + 1] - o.first_point;
  o.lane_count = lane_count(index);
  o.has_friction = o.has_rolling_friction = o.has_face_patch = false;
  o.has_impulse_limit = o.has_surface_spin = o.has_moving_points = false;
  return o;
}

}  // namespace smartsurf::world

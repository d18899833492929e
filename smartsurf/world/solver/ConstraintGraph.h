// The constraint graph: colours the manifolds so that no body occurs twice within a colour, and packs each
// colour into contact batches for the SIMD kernels, for each member of the team those of its slabs. Colours
// and ranks depend on the manifolds and their slabs only, not on the number of members.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "smartsurf/world/body/BodyStore.h"
#include "smartsurf/world/broadphase/SpatialPartition.h"
#include "smartsurf/world/contact/Contact.h"
#include "smartsurf/world/parallel/Team.h"
#include "smartsurf/world/solver/ContactKernels.h"

namespace smartsurf::world {

// Batches [first, first + count), all of one kind.
struct BatchRange {
  ContactKind kind = kSpherePair;
  int first = 0, count = 0;
};

// Ranges of batches by colour; static contacts count as the last colour.
struct BatchRangesByColour {
  std::vector<BatchRange> ranges;
  std::vector<std::size_t> first_of_colour{0};  // by colour: first entry in `ranges`; one more at the end

  std::span<const BatchRange> of(std::size_t colour) const {
    return std::span(ranges).subspan(first_of_colour[colour],
                                     first_of_colour[colour + 1] - first_of_colour[colour]);
  }
  void clear() {
    ranges.clear();
    first_of_colour.assign(1, 0);
  }
  // Extends the last range of the current colour if `next` continues it, otherwise adds a range.
  void append(const BatchRange& next) {
    const bool follows = ranges.size() > first_of_colour.back() && ranges.back().kind == next.kind &&
                         ranges.back().first + ranges.back().count == next.first;
    if (follows)
      ranges.back().count += next.count;
    else if (next.count > 0)
      ranges.push_back(next);
  }
  // Starts the next colour.
  void end_colour() { first_of_colour.push_back(ranges.size()); }
};

class ConstraintGraph {
 public:
  struct Input {
    const BodyStore& bodies;
    const ContactList &pair_contacts, &static_contacts;
    const SlabRanges &pair_ranges, &static_ranges;
  };
  // Colours the manifolds and sorts them. Called by all members; `slabs` are those of the member.
  void build(const Input&, IndexRange slabs, const Member&);
  // Then packs the batches. Called by one thread, before any member reads them.
  void pack_batches(const Input&);

  // Colours must be solved one after the other, the batches of a colour in any order. The last colour may be
  // the overflow set of manifolds that found no colour: one lane per batch, to be solved in order. Static
  // contacts come last: one manifold per body.
  int colour_count() const { return colour_count_; }
  bool has_overflow() const { return colour_count_ > kMaxColours; }

  // The batches of the member's slabs of the i-th colour; for i = colour_count(), those of static contacts.
  // The overflow set belongs to the caller of Team::run. The batches of a member lie together in memory.
  std::span<const BatchRange> own_batches(const Member& member, std::size_t i) const {
    return member_batches_[member.index].of(i);
  }
  // The member's batches of all colours.
  std::span<const BatchRange> own_batches(const Member& member) const {
    return member_batches_[member.index].ranges;
  }

  // Calls each(kind, batch) for the batches of all members.
  template <class Each>
  void for_each_batch(Each each) const {
    for (const MemberBatchRanges& of_member : member_batches_)
      for (const BatchRange& range : of_member.ranges)
        for (int i = range.first; i < range.first + range.count; ++i) each(range.kind, i);
  }

  int batch_count() const { return static_cast<int>(batch_.size()); }
  const ContactBatch* batches_from(int i) const { return batch_.data() + i; }
  // Initialises a batch, except for its bodies, and returns it.
  ContactBatch& reset_batch(int i);
  const ContactBatch& batch(int i) const { return batch_[i]; }
  // Index of the manifold in a lane, in the list of its kind.
  int manifold(int batch, int lane) const { return sorted_manifolds_[batch_start_[batch] + lane]; }
  int lane_count(int batch) const { return batch_start_[batch + 1] - batch_start_[batch]; }
  // Orders the manifolds by key, then by slab: the same order for any number of members.
  std::pair<int, int> rank(ContactKind kind, int batch, int lane) const {
    const int position = batch_start_[batch] + lane;
    return {manifold_key_[(is_pair(kind) ? 0 : first_static_) + sorted_manifolds_[position]], position};
  }
  int point_count() const { return first_point_.back(); }

 private:
  // Key of a manifold: its group (colour and kind), then its number of points, descending, clamped to
  // kPointCountBuckets. Manifolds are sorted by member, key and slab, those of the overflow set, which belong
  // to the last member, by key and slab.
  static constexpr int kMaxColours = 64;  // not counting the overflow set and static contacts
  static constexpr int kPointCountBuckets = 16;
  static constexpr std::size_t kMaxKeys = 2 * (kMaxColours + 2) * kPointCountBuckets;
  using KeyOffsets = std::array<std::int32_t, kMaxKeys>;  // [0, kPointCountBuckets * group_count()) in use
  struct alignas(128) MemberBatchRanges : BatchRangesByColour {};

  int group_count() const { return 2 * (colour_count_ + 1); }
  bool is_overflow(int group) const { return group / 2 == kMaxColours && has_overflow(); }
  void begin(const Input&, int member_count);
  void colour_pairs(const Input&);
  void count_keys(const BodyStore&, const ContactList&, const SlabRanges&, IndexRange slabs, bool pair,
                  KeyOffsets&);
  void compute_key_offsets();
  void sort_manifolds(const SlabRanges&, IndexRange slabs, std::size_t first_key, KeyOffsets& next_slot);
  void pack_group(ContactKind, int group, std::size_t member, const ContactList&);
  int pack_lanes(int group, int lanes, const KeyOffsets& ends, const ContactList&);

  std::vector<std::uint64_t> body_colours_;  // by body: bit mask of the colours of its manifolds
  std::vector<std::uint8_t> manifold_colour_;
  int colour_count_ = 0;                    // static contacts not included
  std::vector<std::int16_t> manifold_key_;  // pairs first, then static contacts
  std::size_t first_static_ = 0;            // in manifold_key_
  // By member and key: the number of manifolds in the member's slabs, then where the next of them goes in
  // sorted_manifolds_, at last where they end. Groups without any manifold keep zeros.
  std::vector<KeyOffsets> key_offsets_;
  std::vector<std::int32_t> sorted_manifolds_;  // manifold indices in the order of batches and lanes
  // The first position in sorted_manifolds_ and the first point of each batch; one more at the end.
  std::vector<std::int32_t> batch_start_, first_point_;
  std::vector<ContactBatch> batch_;
  std::vector<MemberBatchRanges> member_batches_;  // one per member
};

}  // namespace smartsurf::world

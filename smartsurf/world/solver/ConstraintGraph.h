// The order in which manifolds are solved: coloured, so that within one colour no moving body is in two
// manifolds, and packed into octets for the kernels. It depends on the manifolds and their slabs alone, not
// on threads.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "smartsurf/world/BodyStore.h"
#include "smartsurf/world/Contact.h"
#include "smartsurf/world/parallel/SpatialPartition.h"
#include "smartsurf/world/parallel/Team.h"
#include "smartsurf/world/solver/ContactKernels.h"

namespace smartsurf::world {

// Octets [first, first + count) of one kind.
struct BatchRange {
  ContactKind kind = kSpherePair;
  int first = 0, count = 0;
};

// Runs of octets, colour by colour; the world counts as the last colour.
struct BatchRangesByColour {
  std::vector<BatchRange> ranges;
  std::vector<std::size_t> first_of_colour{0};  // of each colour

  std::span<const BatchRange> of(std::size_t colour) const {
    return std::span(ranges).subspan(first_of_colour[colour],
                                     first_of_colour[colour + 1] - first_of_colour[colour]);
  }
  void clear() {
    ranges.clear();
    first_of_colour.assign(1, 0);
  }
  // Lengthens the colour's last run, where one follows the other.
  void append(const BatchRange& next) {
    const bool follows = ranges.size() > first_of_colour.back() && ranges.back().kind == next.kind &&
                         ranges.back().first + ranges.back().count == next.first;
    if (follows)
      ranges.back().count += next.count;
    else if (next.count > 0)
      ranges.push_back(next);
  }
  void end_colour() { first_of_colour.push_back(ranges.size()); }
};

class ConstraintGraph {
 public:
  // The runs name every manifold once. `slabs`: the member's own. All members of the team together.
  void build(const BodyStore&, const ContactList& pair_contacts, const SlabRanges& pair_ranges,
             const ContactList& static_contacts, const SlabRanges& static_ranges, IndexRange slabs,
             const Member&);

  // Colours one after the other; the octets of one colour in any order. The last may hold what found no
  // colour: one lane an octet, to be taken in order.
  struct Colour {
    BatchRange spheres, general;
    bool is_overflow = false;
  };
  const std::vector<Colour>& colours() const { return colours_; }
  // Against the world: one manifold a body.
  BatchRange sphere_static() const { return sphere_static_; }
  BatchRange general_static() const { return general_static_; }

  // Those octets of the i-th colour that begin in the member's slabs; after the last colour: those with the
  // world. What is to be taken in order is the leader's.
  std::span<const BatchRange> own_batches(const Member& member, std::size_t i) const {
    return member_batches_[static_cast<std::size_t>(member.index)].of(i);
  }
  // All of them.
  std::span<const BatchRange> own_batches(const Member& member) const {
    return member_batches_[static_cast<std::size_t>(member.index)].ranges;
  }

  int batch_count() const { return static_cast<int>(batch_.size()); }
  const ContactBatch* batches_from(int i) const { return batch_.data() + i; }
  // An octet with its points and no bodies yet.
  ContactBatch& reset_batch(int i);
  const ContactBatch& batch(int i) const { return batch_[static_cast<std::size_t>(i)]; }
  // The manifold in a lane, as an index into its list.
  int manifold(int batch, int lane) const {
    return sorted_manifolds_[static_cast<std::size_t>(batch_start_[static_cast<std::size_t>(batch)] + lane)];
  }
  int point_count() const { return first_point_.back(); }

 private:
  // Manifolds are sorted by colour and kind, then by their number of points, as far as kCounts, those with
  // many first, then by slab.
  static constexpr int kMaxColours = 64;  // one more for what finds none, and one for the world
  static constexpr int kPointCountBuckets = 16;
  static constexpr std::size_t kMaxKeys = 2 * (kMaxColours + 2) * kPointCountBuckets;
  using KeyOffsets = std::array<std::int32_t, kMaxKeys>;  // the first keys() of them are in use
  struct alignas(128) MemberBatchRanges : BatchRangesByColour {};

  std::size_t key_count() const {
    return 2 * static_cast<std::size_t>(colour_count_ + 1) * kPointCountBuckets;
  }
  void colour_pairs(const BodyStore&, const ContactList& pair_contacts);
  void count_keys(const BodyStore&, const ContactList&, const SlabRanges&, IndexRange slabs, bool pair,
                  KeyOffsets&);
  void compute_key_offsets(int member_count);
  void sort_manifolds(const SlabRanges&, IndexRange slabs, std::size_t first_key, KeyOffsets& next_slot);
  void pack_batches(const ContactList& pair_contacts, const ContactList& static_contacts);
  BatchRange pack_batches(ContactKind, int group, int lanes, const ContactList&);
  void collect_own_batches(const Member&);
  void append_own_batches(const BatchRange&, const Member&);

  std::vector<std::uint64_t> body_colours_;  // one a body: the colours that its manifolds have
  std::vector<std::uint8_t> manifold_colour_;
  int colour_count_ = 0;                    // manifolds with the world count as one more
  std::vector<std::int16_t> manifold_key_;  // of manifolds: pairs, then world
  // One a member: of each key, how many manifolds its slabs have; then where they begin in order_.
  std::vector<KeyOffsets> key_offsets_;
  std::array<std::int32_t, kMaxKeys + 1> first_of_key_;
  std::vector<std::int32_t> sorted_manifolds_;  // manifolds in the order of the octets' lanes
  std::vector<std::int32_t> batch_start_,
      first_point_;  // of each octet, in order_ and in points; one more at the end
  std::vector<ContactBatch> batch_;
  std::vector<Colour> colours_;
  BatchRange sphere_static_, general_static_;
  std::vector<MemberBatchRanges> member_batches_;  // one a member
};

}  // namespace smartsurf::world

// The order in which manifolds are solved: coloured, so that within one colour no moving body is in two
// manifolds, and packed into octets for the kernels. It depends on the manifolds and their slabs alone, not
// on threads.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "smartsurf/world/Bodies.h"
#include "smartsurf/world/Contact.h"
#include "smartsurf/world/ContactKernels.h"
#include "smartsurf/world/Slabs.h"
#include "smartsurf/world/Team.h"

namespace smartsurf::world {

// Octets [first, first + count) of one kind.
struct OctetRun {
  ContactKind kind = kRoundPair;
  int first = 0, count = 0;
};

// Runs of octets, colour by colour; the world counts as the last colour.
struct OctetRuns {
  std::vector<OctetRun> run;
  std::vector<std::size_t> first{0};  // of each colour

  std::span<const OctetRun> of(std::size_t colour) const {
    return std::span(run).subspan(first[colour], first[colour + 1] - first[colour]);
  }
  void clear() {
    run.clear();
    first.assign(1, 0);
  }
  // Lengthens the colour's last run, where one follows the other.
  void add(const OctetRun& next) {
    const bool follows = run.size() > first.back() && run.back().kind == next.kind &&
                         run.back().first + run.back().count == next.first;
    if (follows)
      run.back().count += next.count;
    else if (next.count > 0)
      run.push_back(next);
  }
  void end_colour() { first.push_back(run.size()); }
};

class Schedule {
 public:
  // The runs name every manifold once. `slabs`: the member's own. All members of the team together.
  void build(const BodyStore&, const ContactList& pairs, const SlabRuns& pair_runs, const ContactList& world,
             const SlabRuns& world_runs, Range slabs, const Member&);

  // Colours one after the other; the octets of one colour in any order. The last may hold what found no
  // colour: one lane an octet, to be taken in order.
  struct Colour {
    OctetRun round, any;
    bool in_order = false;
  };
  const std::vector<Colour>& colours() const { return colours_; }
  // Against the world: one manifold a body.
  OctetRun round_world() const { return round_world_; }
  OctetRun any_world() const { return any_world_; }

  // Those octets of the i-th colour that begin in the member's slabs; after the last colour: those with the
  // world. What is to be taken in order is the leader's.
  std::span<const OctetRun> share(const Member& member, std::size_t i) const {
    return share_[static_cast<std::size_t>(member.index)].of(i);
  }
  // All of them.
  std::span<const OctetRun> share(const Member& member) const {
    return share_[static_cast<std::size_t>(member.index)].run;
  }

  int octets() const { return static_cast<int>(octet_.size()); }
  const Octet* octets_from(int i) const { return octet_.data() + i; }
  // An octet with its points and no bodies yet.
  Octet& clear_octet(int i);
  const Octet& octet(int i) const { return octet_[static_cast<std::size_t>(i)]; }
  // The manifold in a lane, as an index into its list.
  int manifold(int octet, int lane) const {
    return order_[static_cast<std::size_t>(start_[static_cast<std::size_t>(octet)] + lane)];
  }
  int points() const { return first_point_.back(); }

 private:
  // Manifolds are sorted by colour and kind, then by their number of points, as far as kCounts, those with
  // many first, then by slab.
  static constexpr int kColours = 64;  // one more for what finds none, and one for the world
  static constexpr int kCounts = 16;
  static constexpr std::size_t kMostKeys = 2 * (kColours + 2) * kCounts;
  using Places = std::array<std::int32_t, kMostKeys>;  // the first keys() of them are in use
  struct alignas(128) Share : OctetRuns {};

  std::size_t keys() const { return 2 * static_cast<std::size_t>(used_colours_ + 1) * kCounts; }
  void colour_pairs(const BodyStore&, const ContactList& pairs);
  void count_keys(const BodyStore&, const ContactList&, const SlabRuns&, Range slabs, bool pair, Places&);
  void find_places(int members);
  void sort(const SlabRuns&, Range slabs, std::size_t first_key, Places& next);
  void pack(const ContactList& pairs, const ContactList& world);
  OctetRun pack(ContactKind, int group, int lanes, const ContactList&);
  void list_share(const Member&);
  void add_share(const OctetRun&, const Member&);

  std::vector<std::uint64_t> used_;  // one a body: the colours that its manifolds have
  std::vector<std::uint8_t> colour_;
  int used_colours_ = 0;           // manifolds with the world count as one more
  std::vector<std::int16_t> key_;  // of manifolds: pairs, then world
  // One a member: of each key, how many manifolds its slabs have; then where they begin in order_.
  std::vector<Places> place_;
  std::array<std::int32_t, kMostKeys + 1> first_of_key_;
  std::vector<std::int32_t> order_;  // manifolds in the order of the octets' lanes
  std::vector<std::int32_t> start_,
      first_point_;  // of each octet, in order_ and in points; one more at the end
  std::vector<Octet> octet_;
  std::vector<Colour> colours_;
  OctetRun round_world_, any_world_;
  std::vector<Share> share_;  // one a member
};

}  // namespace smartsurf::world

// The order in which manifolds are solved: coloured, so that within one colour no moving body is in two
// manifolds, and packed into octets for the kernels. It depends on the manifolds alone, not on threads.
#pragma once

#include <vector>

#include "smartsurf/world/Bodies.h"
#include "smartsurf/world/Contact.h"
#include "smartsurf/world/ContactKernels.h"
#include "smartsurf/world/Team.h"

namespace smartsurf::world {

// Octets [first, first + count) of one kind.
struct OctetRun {
  int first = 0, count = 0;
};

class Schedule {
 public:
  void build(const BodyStore&, const ContactList& pairs, const ContactList& world);

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

  // One member's share of a run of octets, by their points: those with many come first.
  Range share(const OctetRun&, int member, int members) const;

  int octets() const { return static_cast<int>(octet_.size()); }
  const Octet* octets_from(int i) const { return octet_.data() + i; }
  Octet& octet(int i) { return octet_[static_cast<std::size_t>(i)]; }
  bool pair(int octet) const { return octet < round_world_.first; }
  // The manifold in a lane, as an index into its list.
  int manifold(int octet, int lane) const {
    return order_[static_cast<std::size_t>(start_[static_cast<std::size_t>(octet)] + lane)];
  }
  int points() const { return points_; }

 private:
  void colour_pairs(const BodyStore&, const ContactList& pairs);
  void sort_pairs(const BodyStore&, const ContactList& pairs);
  void sort_world(const BodyStore&, const ContactList& world);
  // A stable counting sort of manifolds 0, 1, … by key_ into order_, from `base` on.
  void sort_by_key(int keys, int base);
  OctetRun pack(const ContactList&, int begin, int end, int lanes);

  std::vector<std::uint64_t> used_;  // one a body: the colours that its manifolds have
  std::vector<std::uint8_t> colour_;
  std::vector<std::int32_t> key_, first_of_key_, next_of_key_;
  std::vector<std::int32_t> order_;  // manifolds in the order of the octets' lanes: pairs, then world
  std::vector<std::int32_t> start_;  // of each octet in order_
  std::vector<Octet> octet_;
  std::vector<Colour> colours_;
  OctetRun round_world_, any_world_;
  int points_ = 0;
};

}  // namespace smartsurf::world

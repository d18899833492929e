#include "smartsurf/world/Detector.h"

#include <algorithm>
#include <bit>
#include <bitset>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>
#include <span>

#include "smartsurf/world/ConvexOnField.h"
#include "smartsurf/world/PairContacts.h"
#include "smartsurf/world/ShapeOnGround.h"
#include "smartsurf/world/SphereOnField.h"

namespace smartsurf::world {
namespace {

// Contacts this near are kept even when nothing moves, so that resting contacts do not flicker, u.
constexpr float kRestMargin = 0.02F;

// The nearest of the old contacts with the same partner that is not taken, or −1. At most so many as taken
// has bits.
template <std::size_t most>
int nearest_old(const Contact& c, std::span<const Contact> old, float square,
                const std::bitset<most>& taken) {
  // Without branches that nobody could foretell: floats from 0 up compare like their bits, the last few of
  // which tell the place.
  constexpr std::int32_t kPlace = most - 1, kNone = std::numeric_limits<std::int32_t>::max();
  static_assert(std::has_single_bit(most));
  const std::int32_t limit = std::bit_cast<std::int32_t>(square) & ~kPlace;
  std::int32_t nearest = limit;
  for (std::size_t j = 0; j < old.size(); ++j) {
    const Contact& o = old[j];
    const auto here = std::bit_cast<std::int32_t>((o.arm - c.arm).squaredNorm());
    const std::int32_t no =
        -static_cast<std::int32_t>(taken[j]) | -static_cast<std::int32_t>(o.other != c.other);
    nearest = std::min(nearest, ((here & ~kPlace) | static_cast<std::int32_t>(j)) | (no & kNone));
  }
  return nearest == limit ? -1 : nearest & kPlace;
}

template <std::size_t most>
void inherit_from(std::span<Contact> now, std::span<const Contact> old, float tolerance) {
  std::bitset<most> taken;
  old = old.first(std::min(old.size(), most));
  for (Contact& c : now) {
    const int best = nearest_old(c, old, tolerance * tolerance, taken);
    if (best < 0) continue;
    taken.set(static_cast<std::size_t>(best));
    const Contact& o = old[static_cast<std::size_t>(best)];
    c.push = o.push;
    c.drag = o.drag - c.normal * c.normal.dot(o.drag);
    c.roll = o.roll;
  }
}

// Hands the impulses of old contacts on to the nearest new ones with the same partner, each once.
void inherit(ContactList& list, const Manifold& now, const ContactList& old, int manifold, float tolerance) {
  if (manifold < 0) return;
  const Manifold& before = old.manifolds[static_cast<std::size_t>(manifold)];
  auto of = [](auto& contacts, const Manifold& m) {
    return std::span(contacts).subspan(static_cast<std::size_t>(m.first), static_cast<std::size_t>(m.count));
  };
  constexpr std::size_t kFew = 64, kMost = 1024;
  if (static_cast<std::size_t>(before.count) <= kFew)
    inherit_from<kFew>(of(list.contacts, now), of(old.contacts, before), tolerance);
  else
    inherit_from<kMost>(of(list.contacts, now), of(old.contacts, before), tolerance);
}

}  // namespace

void Detector::arrange(const BodyStore& bodies, const Member& member) {
  member.alone([&] {
    if (large_ >= 0.0F) return;
    find_large_size(bodies);
    reach_.resize(bodies.reach.size());
    margin_.resize(bodies.reach.size());
  });
  const auto own = own_bodies(member);
  reach_out(bodies, own);
  grid_.build({bodies.position, reach_, large_}, own, member);
  member.alone([&] {
    slabs_.cut(grid_);
    // Where as much lies as in the last step, as much is to be done.
    if (contacts_in_.size() == static_cast<std::size_t>(slabs_.slabs())) slabs_.weigh(contacts_in_);
  });
}

std::span<const std::int32_t> Detector::own_bodies(const Member& member) const {
  if (member.members > 1 && slabs_.rows() == static_cast<int>(all_.size())) return slabs_.bodies_of(member);
  const Range share = member.share(static_cast<int>(all_.size()));
  return std::span(all_).subspan(static_cast<std::size_t>(share.begin),
                                 static_cast<std::size_t>(share.end - share.begin));
}

// Before the look: the last step's contacts become the old ones.
void Detector::begin(ContactList& pairs, ContactList& world, int members) {
  old_.take(pairs, world, members);
  const auto slabs = static_cast<std::size_t>(slabs_.slabs());
  if (found_.size() < slabs) found_.resize(slabs);
  pair_part_.resize(slabs_.pieces().size());
  world_part_.resize(slabs_.pieces().size());
  for (std::size_t s = 0; s < found_.size(); ++s) {
    found_[s].pairs.clear();
    found_[s].world.clear();
    pair_memory_.take(static_cast<int>(s), found_[s].known_pairs);
    field_memory_.take(static_cast<int>(s), found_[s].known_field);
  }
}

void Detector::detect(const BodyStore& bodies, ContactList& pairs, ContactList& world, const Member& member) {
  member.alone([&] { begin(pairs, world, member.members); });
  old_.index(bodies.id.size(), pair_runs_, world_runs_, member);
  if (member.index == 0) {
    look_around_large(bodies);
    pair_memory_.index(bodies.size());
  }
  if (member.leads()) field_memory_.index(bodies.size());
  slabs_.list_rows(bodies, grid_, member);
  member.meet();
  const Range mine = slabs_.share(member);
  old_.found(mine, member);
  for (int s = mine.begin; s < mine.end; ++s) {
    Findings& found = found_[static_cast<std::size_t>(s)];
    found.member = member.index;
    detect_slab(bodies, s, found);
  }
  member.alone([&] {
    place_parts(pair_part_, pairs, pair_runs_);
    place_parts(world_part_, world, world_runs_);
    weigh_slabs();
  });
  for (int s = mine.begin; s < mine.end; ++s) {
    const Findings& found = found_[static_cast<std::size_t>(s)];
    copy_slab(s, pair_part_, found.pairs, pairs, pair_runs_);
    copy_slab(s, world_part_, found.world, world, world_runs_);
  }
}

void Detector::weigh_slabs() {
  contacts_in_.clear();
  for (int s = 0; s < slabs_.slabs(); ++s) {
    const Findings& found = found_[static_cast<std::size_t>(s)];
    contacts_in_.push_back(found.pairs.contacts.size() + found.world.contacts.size());
  }
  slabs_.weigh(contacts_in_);
}

// Most bodies decide what is large; a few that are much larger must not make the cells of all the others
// wide.
void Detector::find_large_size(const BodyStore& bodies) {
  std::vector<float> reach;
  for (std::size_t i = 0; i < bodies.reach.size(); ++i)
    if (!bodies.fixed(i)) reach.push_back(bodies.reach[i]);
  large_ = 1.0F;
  if (reach.empty()) return;
  const auto middle = reach.begin() + static_cast<std::ptrdiff_t>(reach.size() / 2);
  std::nth_element(reach.begin(), middle, reach.end());
  large_ = 4.0F * *middle;
}

void Detector::reach_out(const BodyStore& bodies, std::span<const std::int32_t> own) {
  for (const std::int32_t body : own) {
    const auto i = static_cast<std::size_t>(body);
    float travel = 0.0F;
    if (bodies.moves(i)) {
      travel = bodies.velocity(i).norm();
      if (!bodies.round[i]) travel += bodies.spin(i).norm() * bodies.reach[i];
    }
    margin_[i] = std::max(kRestMargin, travel * dt_s_);
    // Fixed bodies count as large: they are looked up, and have no contacts of their own.
    reach_[i] = bodies.fixed(i) ? 1e30F : bodies.reach[i] + std::min(margin_[i], bodies.reach[i]);
  }
}

void Detector::look_around_large(const BodyStore& bodies) {
  near_.clear();
  for (const std::int32_t l : grid_.large()) {
    const auto i = static_cast<std::size_t>(l);
    const Vec3 half = bodies.axes[i].cwiseAbs() * bodies.shape[i]->half + Vec3::Constant(margin_[i]);
    grid_.for_box(bodies.position[i] - half, bodies.position[i] + half, [&](std::int32_t body) {
      near_.push_back({body, l});
    });
  }
  std::stable_sort(near_.begin(), near_.end(),
                   [](const NearLarge& a, const NearLarge& b) { return a.body < b.body; });
  first_near_.assign(static_cast<std::size_t>(bodies.size()) + 1, 0);
  for (const NearLarge& n : near_) ++first_near_[static_cast<std::size_t>(n.body) + 1];
  for (std::size_t i = 1; i < first_near_.size(); ++i) first_near_[i] += first_near_[i - 1];
}

void Detector::detect_slab(const BodyStore& bodies, int slab, Findings& out) {
  auto begin = [](Part& part, const ContactList& list) {
    part.from = {list.manifolds.size(), list.contacts.size()};
  };
  auto end = [](Part& part, const ContactList& list) {
    part.count = {list.manifolds.size() - part.from.manifolds, list.contacts.size() - part.from.contacts};
  };
  for (const std::int32_t p : slabs_.pieces_of(slab)) {
    const auto i = static_cast<std::size_t>(p);
    begin(pair_part_[i], out.pairs), begin(world_part_[i], out.world);
    if (slab + 1 == slabs_.slabs())
      detect_large(bodies, out);
    else
      detect_piece(bodies, slabs_.pieces()[i], out);
    end(pair_part_[i], out.pairs), end(world_part_[i], out.world);
  }
}

void Detector::detect_piece(const BodyStore& bodies, const Slabs::Piece& piece, Findings& out) const {
  for (int k = piece.begin; k < piece.end; ++k) {
    const auto i = static_cast<std::size_t>(grid_.body(k));
    if (bodies.moves(i)) touch_world(bodies, i, out);
    for (int n = first_near_[i]; n < first_near_[i + 1]; ++n) {
      const auto large = static_cast<std::size_t>(near_[static_cast<std::size_t>(n)].large);
      if (!bodies.fixed(large)) touch_pair(bodies, i, large, out);
    }
  }
  grid_.for_pairs(piece.begin, piece.end, [&](std::int32_t i, std::int32_t j) {
    touch_pair(bodies, static_cast<std::size_t>(i), static_cast<std::size_t>(j), out);
  });
}

void Detector::detect_large(const BodyStore& bodies, Findings& out) const {
  const auto large = grid_.large();
  for (std::size_t k = 0; k < large.size(); ++k) {
    const auto i = static_cast<std::size_t>(large[k]);
    if (bodies.moves(i)) touch_world(bodies, i, out);
    for (std::size_t other = k + 1; other < large.size(); ++other) {
      const auto j = static_cast<std::size_t>(large[other]);
      if (!bodies.fixed(i) && !bodies.fixed(j)) touch_pair(bodies, i, j, out);
    }
  }
}

void Detector::touch_world(const BodyStore& bodies, std::size_t i, Findings& found) const {
  ContactList& out = found.world;
  const auto first = static_cast<std::int32_t>(out.contacts.size());
  const Vec3& centre = bodies.position[i];
  const float margin = std::max(kRestMargin, margin_[i] + field_.max_speed * dt_s_);
  if (bodies.round[i] && !loose_)
    touch_field_with_sphere(field_, centre, bodies.reach[i], margin, out.contacts);
  else if (loose_ || field_.yields())
    touch_field(*bodies.shape[i], centre, bodies.axes[i], margin, out.contacts);
  else
    field_memory_.touch(bodies, i, margin, found.known_field, out.contacts);
  if (centre.z() - bodies.reach[i] - margin < ground_)
    touch_ground(*bodies.shape[i], centre, bodies.axes[i], ground_, margin, out.contacts);
  if (reach_[i] <= large_) {
    for (int n = first_near_[i]; n < first_near_[i + 1]; ++n) {
      const auto large = static_cast<std::size_t>(near_[static_cast<std::size_t>(n)].large);
      if (bodies.fixed(large)) touch_fixed(bodies, i, large, found);
    }
  } else {
    for (const std::int32_t large : grid_.large())
      if (bodies.fixed(static_cast<std::size_t>(large)))
        touch_fixed(bodies, i, static_cast<std::size_t>(large), found);
  }
  const auto count = static_cast<std::int32_t>(out.contacts.size()) - first;
  if (count == 0) return;
  out.manifolds.push_back({static_cast<std::int32_t>(i), kField, first, count});
  inherit(out, out.manifolds.back(), old_.world(), old_.with_world(i, found.member), 0.15F * bodies.reach[i]);
}

void Detector::touch_field(const Shape& shape, const Vec3& centre, const Mat3& axes, float margin,
                           std::vector<Contact>& out) const {
  if (loose_)
    loose_->touch(shape, centre, axes, margin, out);
  else if (shape.round())
    touch_field_with_sphere(field_, centre, shape.reach, margin, out);
  else
    touch_field_with_shape(field_, shape, centre, axes, margin, out);
}

bool Detector::field_reaches(const Vec3& low, const Vec3& high) const {
  if (low.z() > field_.max_height) return false;
  if (loose_) return true;
  const Columns columns(field_, 0.0F);
  return low.z() <= columns.highest(columns.covering(low.x(), high.x(), low.y(), high.y()));
}

void Detector::touch_fixed(const BodyStore& bodies, std::size_t i, std::size_t fixed, Findings& found) const {
  ContactList& out = found.world;
  const std::size_t first = out.contacts.size();
  touch_bodies(bodies, i, fixed, margin_[i], dt_s_, old_.normal(i, fixed, found.member), out.contacts);
  for (std::size_t k = first; k < out.contacts.size(); ++k)
    out.contacts[k].other = static_cast<std::int32_t>(fixed);
}

void Detector::touch_pair(const BodyStore& bodies, std::size_t i, std::size_t j, Findings& out) const {
  if (!bodies.moves(i) && !bodies.moves(j)) return;
  const std::size_t a = std::min(i, j), b = std::max(i, j);
  const bool round = bodies.round[a] || bodies.round[b];
  ContactList& pairs = out.pairs;
  const auto first = static_cast<std::int32_t>(pairs.contacts.size());
  if (round) {
    touch_bodies(bodies, a, b, kRestMargin, dt_s_, nullptr, pairs.contacts);
  } else {
    const float margin = kRestMargin + closing(bodies, a, b, dt_s_);
    pair_memory_.touch(bodies, a, b, margin, out.known_pairs, pairs.contacts);
  }
  const auto count = static_cast<std::int32_t>(pairs.contacts.size()) - first;
  if (count == 0) return;
  pairs.manifolds.push_back({static_cast<std::int32_t>(a), static_cast<std::int32_t>(b), first, count});
  // A sphere has one contact with each of the others: its arm may turn far in one step.
  const float tolerance = round ? bodies.reach[a] : 0.15F * bodies.reach[a];
  inherit(pairs, pairs.manifolds.back(), old_.pairs(), old_.pair(a, b, out.member), tolerance);
}

// The pieces' contacts one after the other, in the grid's order, whatever the slabs.
void Detector::place_parts(std::vector<Part>& parts, ContactList& list, SlabRuns& runs) const {
  Extent at;
  for (Part& part : parts) {
    part.to = at;
    at.manifolds += part.count.manifolds;
    at.contacts += part.count.contacts;
  }
  list.manifolds.resize(at.manifolds);
  list.contacts.resize(at.contacts);
  runs.manifolds = at.manifolds;
  runs.run.resize(parts.size());
  runs.first.clear();
  for (int s = 0; s <= slabs_.slabs(); ++s)
    runs.first.push_back(static_cast<std::int32_t>(slabs_.first_piece_of(s)));
}

void Detector::copy_slab(int slab, const std::vector<Part>& parts, const ContactList& list,
                         ContactList& to_list, SlabRuns& runs) const {
  std::size_t run = slabs_.first_piece_of(slab);
  for (const std::int32_t p : slabs_.pieces_of(slab)) {
    const auto& [from, to, count] = parts[static_cast<std::size_t>(p)];
    const auto further = static_cast<std::int32_t>(to.contacts) - static_cast<std::int32_t>(from.contacts);
    for (std::size_t k = 0; k < count.manifolds; ++k) {
      const Manifold& m = list.manifolds[from.manifolds + k];
      to_list.manifolds[to.manifolds + k] = {m.a, m.b, m.first + further, m.count};
    }
    // As bytes, for they are numbers only, which the compiler does not see: it would copy them one by one.
    if (count.contacts > 0)
      std::memcpy(static_cast<void*>(&to_list.contacts[to.contacts]),
                  static_cast<const void*>(&list.contacts[from.contacts]), count.contacts * sizeof(Contact));
    runs.run[run++] = {static_cast<int>(to.manifolds), static_cast<int>(to.manifolds + count.manifolds)};
  }
}

}  // namespace smartsurf::world

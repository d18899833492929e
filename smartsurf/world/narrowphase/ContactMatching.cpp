#include "smartsurf/world/narrowphase/ContactMatching.h"

#include <algorithm>
#include <bit>
#include <limits>

#include "smartsurf/world/simd/Simd4.h"

namespace smartsurf::world {
namespace {

// A contact matches one of the previous step with the same value. Support patches are found after matching.
std::int32_t match_key(const Contact& c) {
  return static_cast<std::int32_t>(c.is_in_patch() ? Partner::kCell : c.partner);
}

// Anchors of at most `capacity` contacts of the previous step, four at a time.
template <int capacity>
class PreviousAnchors {
  static_assert(std::has_single_bit(static_cast<unsigned>(capacity)) && capacity % kSimd4Width == 0);

 public:
  explicit PreviousAnchors(std::span<const Contact> previous)
      : blocks_((static_cast<int>(previous.size()) + kSimd4Width - 1) / kSimd4Width) {
    for (int i = 0; i < blocks_; ++i) {
      const Contact* c[kSimd4Width];
      std::int32_t key[kSimd4Width];
      for (int k = 0; k < kSimd4Width; ++k) {
        const std::size_t at = kSimd4Width * i + k;
        c[k] = &previous[at < previous.size() ? at : 0];
        key[k] = at < previous.size() ? match_key(*c[k]) : kTaken;
      }
      x_[i] = Float4{c[0]->anchor.x(), c[1]->anchor.x(), c[2]->anchor.x(), c[3]->anchor.x()};
      y_[i] = Float4{c[0]->anchor.y(), c[1]->anchor.y(), c[2]->anchor.y(), c[3]->anchor.y()};
      z_[i] = Float4{c[0]->anchor.z(), c[1]->anchor.z(), c[2]->anchor.z(), c[3]->anchor.z()};
      key_[i] = Int4{key[0], key[1], key[2], key[3]};
    }
  }

  // Index of the nearest contact with the same partner that was not taken yet, or −1. Takes it.
  int take_nearest(const Contact& c, float max_distance_squared) {
    // Branch-free, because the outcome is unpredictable: non-negative floats order like their bits, so the
    // low bits of the squared distance can carry the index.
    const std::int32_t key = match_key(c);
    constexpr std::int32_t kIndexMask = capacity - 1, kNone = std::numeric_limits<std::int32_t>::max();
    const std::int32_t limit = std::bit_cast<std::int32_t>(max_distance_squared) & ~kIndexMask;
    Int4 nearest = Int4{} + limit, index{0, 1, 2, 3};
    for (int i = 0; i < blocks_; ++i, index += kSimd4Width) {
      const Float4 x = x_[i] - c.anchor.x(), y = y_[i] - c.anchor.y(), z = z_[i] - c.anchor.z();
      const Int4 distance = (as_int_bits(x * x + (y * y + z * z)) & ~kIndexMask) | index;
      const Int4 candidate = key_[i] == key ? distance : Int4{} + kNone;
      nearest = candidate < nearest ? candidate : nearest;
    }
    const std::int32_t least = horizontal_min(nearest);
    if (least == limit) return -1;
    const int found = least & kIndexMask;
    Int4& block = key_[found / kSimd4Width];
    block = Int4{0, 1, 2, 3} == found % kSimd4Width ? Int4{} + kTaken : block;
    return found;
  }

 private:
  static constexpr std::int32_t kTaken = std::numeric_limits<std::int32_t>::min();  // no contact's key
  static constexpr std::size_t kBlocks = capacity / kSimd4Width;
  int blocks_;
  Float4 x_[kBlocks], y_[kBlocks], z_[kBlocks];
  Int4 key_[kBlocks];
};

void copy_impulses(const Contact& from, Contact& to) {
  to.normal_impulse = from.normal_impulse;
  to.friction_impulse = from.friction_impulse - to.normal * to.normal.dot(from.friction_impulse);
  to.rolling_impulse = from.rolling_impulse;
  to.max_cell_impulse = from.max_cell_impulse;
}

template <int capacity>
void match_nearest(std::span<Contact> current, std::span<const Contact> previous, float tolerance) {
  previous = previous.first(std::min<std::size_t>(previous.size(), capacity));
  PreviousAnchors<capacity> anchors(previous);
  for (Contact& c : current)
    if (const int i = anchors.take_nearest(c, tolerance * tolerance); i >= 0) copy_impulses(previous[i], c);
}

}  // namespace

void match_contacts(ContactList& list, const Manifold& current, const ContactList& previous, int manifold,
                    float tolerance) {
  if (manifold < 0) return;
  const std::span<Contact> contacts = list.contacts_of(current);
  const std::span<const Contact> old = previous.contacts_of(previous.manifolds[manifold]);
  constexpr std::size_t kSmallCapacity = 64, kMaxCapacity = 1024;
  if (contacts.size() == 1 && old.size() == 1) {  // as of all pairs of spheres
    if (match_key(contacts[0]) == match_key(old[0]) &&
        (old[0].anchor - contacts[0].anchor).squaredNorm() < tolerance * tolerance)
      copy_impulses(old[0], contacts[0]);
  } else if (old.size() <= kSmallCapacity) {
    match_nearest<kSmallCapacity>(contacts, old, tolerance);
  } else {
    match_nearest<kMaxCapacity>(contacts, old, tolerance);
  }
}

bool match_points(std::span<Contact> contacts, std::span<const Contact> previous,
                  const PairManifoldCache::Points& points, float tolerance) {
  if ((points.touching & ~points.touched) != 0 || std::popcount(points.touched) != std::ssize(previous))
    return false;
  // Calls each(contact, its previous one).
  const auto for_each_point = [&](auto each) {
    Contact* contact = contacts.data();
    const Contact* before = previous.data();
    for (std::uint32_t left = points.touched; left != 0; left &= left - 1, ++before)
      if (points.touching & left & (~left + 1)) each(*contact++, *before);
  };
  const float limit = 0.25F * std::min(tolerance, points.gap);
  bool are_near = true;
  for_each_point([&](const Contact& c, const Contact& before) {
    are_near &= (before.anchor - c.anchor).squaredNorm() < limit * limit;
  });
  if (are_near) for_each_point([](Contact& c, const Contact& before) { copy_impulses(before, c); });
  return are_near;
}

}  // namespace smartsurf::world

#include "smartsurf/world/CollisionPipeline.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>
#include <span>

#include "smartsurf/world/field/ConvexOnField.h"
#include "smartsurf/world/field/SphereOnField.h"
#include "smartsurf/world/narrowphase/InternalEdges.h"
#include "smartsurf/world/narrowphase/PairContacts.h"
#include "smartsurf/world/narrowphase/PairSweep.h"
#include "smartsurf/world/simd/Simd4.h"

namespace smartsurf::world {
namespace {

// A contact matches one of the previous step with the same value. Support patches are found after matching.
std::int32_t match_key(const Contact& c) {
  const bool is_supported = c.partner == Partner::kSupportedCell || c.partner == Partner::kElasticTop;
  return static_cast<std::int32_t>(is_supported ? Partner::kCell : c.partner);
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
        const auto at = static_cast<std::size_t>(kSimd4Width * i + k);
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
  previous = previous.first(std::min(previous.size(), static_cast<std::size_t>(capacity)));
  PreviousAnchors<capacity> anchors(previous);
  for (Contact& c : current)
    if (const int i = anchors.take_nearest(c, tolerance * tolerance); i >= 0) copy_impulses(previous[i], c);
}

// Copies impulses for warm starting: each current contact takes those of the nearest previous contact within
// `tolerance` (distance of anchors, u) with the same partner; each previous contact is used once. `manifold`:
// index in `previous`, or −1.
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

// As match_contacts() between two bodies, for a manifold that was kept and whose points all had contacts in
// the last step: these are known by their points, unless one has moved so far that another may be nearer.
// Returns false and does nothing then.
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

// Collision detection measures from the origin of the shape.
void anchor_at_centre_of_mass(const BodyStore& bodies, std::size_t i, std::vector<Contact>& contacts,
                              std::size_t first) {
  if (!bodies.has_offsets) return;
  for (std::size_t k = first; k < contacts.size(); ++k) contacts[k].anchor += bodies.origin_offset[i];
}

}  // namespace

void CollisionPipeline::update_sleepers(const BodyStore& bodies, unsigned version) {
  if (large_radius_ >= 0.0F && sleeper_version_ == version) return;
  sleeper_version_ = version;
  if (large_radius_ < 0.0F) {
    compute_large_radius(bodies);
    measure_bodies(bodies);
    query_radius_.resize(bodies.bounding_radius.size());
    speculative_margin_.resize(bodies.bounding_radius.size());
    half_extents_.resize(bodies.bounding_radius.size());
    travel_.resize(bodies.bounding_radius.size());
  }
  thread_local std::vector<std::int32_t> sleepers;
  sleepers.clear();
  grid_bodies_.clear();
  for (const std::int32_t i : body_indices_) (bodies.asleep[i] ? sleepers : grid_bodies_).push_back(i);
  compute_query_radii(bodies, sleepers);
  sleepers_low_ = Vec3::Constant(std::numeric_limits<float>::infinity()), sleepers_high_ = -sleepers_low_;
  for (const std::int32_t i : sleepers) {
    const Vec3 radius = Vec3::Constant(query_radius_[i]);
    sleepers_low_ = sleepers_low_.cwiseMin(bodies.position[i] - radius);
    sleepers_high_ = sleepers_high_.cwiseMax(bodies.position[i] + radius);
  }
  Barrier alone(1);
  sleeper_grid_.build({bodies.position, query_radius_, large_radius_, sleepers}, sleepers, {0, 1, alone});
}

void CollisionPipeline::update_broadphase(const BodyStore& bodies, const Member& member) {
  member.single([&] {
    grid_ = &UniformGrid::of_this_thread();
    overloaded_ = false;
    max_travel_.assign(member.member_count, 0.0F);
    update_sleepers(bodies, sleeper_version_);
  });
  const auto own = own_bodies_in_grid(member);
  max_travel_[member.index] = compute_query_radii(bodies, own);
  grid_->build({bodies.position, query_radius_, large_radius_, grid_bodies_}, own, member);
  member.single([&] {
    partition_.build(*grid_, bodies.size());
    find_fast_bodies(bodies);
    // With the same number of slabs, the previous contact counts are a good estimate of the work.
    if (contacts_per_slab_.size() == static_cast<std::size_t>(partition_.slab_count()))
      partition_.set_contact_counts(contacts_per_slab_);
  });
}

std::span<const std::int32_t> CollisionPipeline::own_bodies(const Member& member) const {
  if (member.member_count > 1 && partition_.row_count() == static_cast<int>(body_indices_.size()))
    return partition_.bodies_of(member);
  const IndexRange share = member.share(static_cast<int>(body_indices_.size()));
  return std::span(body_indices_).subspan(share.begin, share.end - share.begin);
}

// Returns own_bodies() without the sleepers.
std::span<const std::int32_t> CollisionPipeline::own_bodies_in_grid(const Member& member) const {
  if (!has_sleepers()) return own_bodies(member);
  const IndexRange share = member.share(static_cast<int>(grid_bodies_.size()));
  return std::span(grid_bodies_).subspan(share.begin, share.end - share.begin);
}

std::size_t CollisionPipeline::tested_pairs() const {
  std::size_t sum = 0;
  for (const SlabResults& results : slab_results_) sum += results.tested_pairs;
  return sum;
}

// Makes the contacts and caches of the last step the previous ones and empties the output buffers.
void CollisionPipeline::begin_detection(const BodyStore& bodies, ContactList& pair_contacts,
                                        ContactList& static_contacts, int member_count) {
  const int body_count = bodies.size();
  previous_contacts_.swap_lists(pair_contacts, static_contacts, member_count);
  finds_in_order_ = member_count == 1 && partition_.slab_count() <= 2;
  pair_contacts.contacts.clear();
  static_contacts.contacts.clear();
  if (finds_in_order_) pair_contacts.manifolds.clear(), static_contacts.manifolds.clear();
  max_pairs_ = kMaxPairsPerBody * static_cast<std::size_t>(body_count);
  const auto slabs = static_cast<std::size_t>(partition_.slab_count());
  if (slab_results_.size() < slabs) slab_results_.resize(slabs);
  pair_output_.resize(partition_.body_runs().size());
  static_output_.resize(partition_.body_runs().size());
  for (std::size_t s = 0; s < slab_results_.size(); ++s) {
    slab_results_[s].overloaded = false;
    slab_results_[s].expected_pair = 0;
    slab_results_[s].pair_contacts.clear();
    slab_results_[s].swept_pairs.clear();
    slab_results_[s].touched_sleepers.clear();
    slab_results_[s].tested_pairs = 0;
    slab_results_[s].static_contacts.clear();
    if (bodies.non_spheres == 0) continue;  // only others have cached manifolds
    pair_cache_.swap_in(static_cast<int>(s), slab_results_[s].cached_pairs);
    field_cache_.swap_in(static_cast<int>(s), slab_results_[s].cached_field);
  }
  if (bodies.non_spheres > 0)
    swap_supports(body_count);
  else
    support_slabs_ = 0;
}

// Makes the support patches of the last step the previous ones and indexes them by body.
void CollisionPipeline::swap_supports(int bodies) {
  std::swap(supports_, previous_supports_);
  const auto slabs = static_cast<std::size_t>(partition_.slab_count());
  const std::size_t previous_slabs = support_slabs_;
  support_slabs_ = slabs;
  if (supports_.size() < slabs) supports_.resize(slabs);
  for (std::size_t s = 0; s < slabs; ++s) {
    supports_[s].clear();
    slab_results_[s].supports = &supports_[s];
  }
  previous_support_of_body_.clear(bodies);
  for (std::size_t s = 0; s < previous_slabs; ++s)
    for (std::size_t k = 0; k < previous_supports_[s].patches.size(); ++k)
      previous_support_of_body_.set(previous_supports_[s].patches[k].body,
                                    {static_cast<std::int32_t>(s), static_cast<std::int32_t>(k)});
}

void CollisionPipeline::find_contacts(const BodyStore& bodies, ContactList& pair_contacts,
                                      ContactList& static_contacts, const Member& member) {
  member.single([&] { begin_detection(bodies, pair_contacts, static_contacts, member.member_count); });
  previous_contacts_.build_index(bodies.id.size(), pair_ranges_, static_ranges_, member);
  if (member.index == 0) {
    find_large_neighbours(bodies);
    if (bodies.non_spheres > 0) pair_cache_.build_index(bodies.size());
  }
  if (member.is_caller() && bodies.non_spheres > 0) field_cache_.build_index(bodies.size());
  partition_.assign_rows(bodies, *grid_, member);
  member.arrive_and_wait();
  const IndexRange own_slabs = partition_.share(member);
  previous_contacts_.set_own_slabs(own_slabs, member);
  for (int s = own_slabs.begin; s < own_slabs.end; ++s) {
    SlabResults& results = slab_results_[s];
    results.member = member.index;
    if (member.member_count == 1)
      collide_slab_in_place(bodies, s, results, pair_contacts, static_contacts);
    else
      collide_slab(bodies, s, results);
  }
  member.single([&] {
    overloaded_ = std::ranges::any_of(slab_results_, &SlabResults::overloaded);
    if (overloaded_) {
      pair_contacts.clear();
      static_contacts.clear();
      return;
    }
    if (finds_in_order_) {
      set_ranges(pair_output_, pair_ranges_);
      set_ranges(static_output_, static_ranges_);
    } else {
      assign_output_offsets(pair_output_, pair_contacts, pair_ranges_);
      assign_output_offsets(static_output_, static_contacts, static_ranges_);
      if (member.member_count > 1) assign_contact_offsets(pair_contacts, static_contacts);
      update_slab_weights();
    }
    if (has_sleepers()) add_rows_of_sleepers(bodies);
  });
  if (overloaded_ || finds_in_order_) return;
  for (int s = own_slabs.begin; s < own_slabs.end; ++s) {
    const SlabResults& results = slab_results_[s];
    merge_slab(s, pair_output_, results.pair_contacts, results.first_pair_contact, pair_contacts,
               pair_ranges_);
    merge_slab(s, static_output_, results.static_contacts, results.first_static_contact, static_contacts,
               static_ranges_);
  }
}

void CollisionPipeline::archive(common::StateArchive& a, int bodies) {
  const auto slabs = a.value(static_cast<std::uint64_t>(slab_results_.size()));
  if (slab_results_.size() < slabs) slab_results_.resize(slabs);
  for (std::size_t s = 0; s < slab_results_.size(); ++s) {
    SlabResults& results = slab_results_[s];
    if (s < slabs)
      results.cached_pairs.archive(a), results.cached_field.archive(a);
    else
      results.cached_pairs = {}, results.cached_field = {};
  }
  support_slabs_ = a.value(static_cast<std::uint64_t>(support_slabs_));
  if (supports_.size() < support_slabs_) supports_.resize(support_slabs_);
  for (std::size_t s = 0; s < support_slabs_; ++s) supports_[s].archive(a);
  if (a.saves()) return;
  large_radius_ = -1.0F;
  body_indices_.resize(bodies);
  std::iota(body_indices_.begin(), body_indices_.end(), 0);
  previous_contacts_.forget_slabs();
}

void CollisionPipeline::update_slab_weights() {
  contacts_per_slab_.clear();
  for (int s = 0; s < partition_.slab_count(); ++s)
    contacts_per_slab_.push_back(slab_results_[s].contact_count);
  partition_.set_contact_counts(contacts_per_slab_);
}

// Bodies above four times the median radius are large: a few of them must not widen the grid cells for all
// others.
void CollisionPipeline::compute_large_radius(const BodyStore& bodies) {
  std::vector<float> reach;
  for (std::size_t i = 0; i < bodies.bounding_radius.size(); ++i)
    if (!bodies.is_static(i)) reach.push_back(bodies.bounding_radius[i]);
  large_radius_ = 1.0F;
  if (reach.empty()) return;
  const auto middle = reach.begin() + static_cast<std::ptrdiff_t>(reach.size() / 2);
  std::nth_element(reach.begin(), middle, reach.end());
  large_radius_ = 4.0F * *middle;
}

void CollisionPipeline::measure_bodies(const BodyStore& bodies) {
  thickness_.clear();
  fast_margin_.clear();
  least_thickness_ = std::numeric_limits<float>::infinity();
  any_compound_ = false;
  for (std::size_t i = 0; i < bodies.bounding_radius.size(); ++i) {
    float thickness = bodies.width[i];
    for (const ConvexHullShape& hull : bodies.shape[i]->hulls) thickness = std::min(thickness, hull.width);
    thickness_.push_back(thickness);
    least_thickness_ = std::min(least_thickness_, thickness);
    any_compound_ |= bodies.shape[i]->hulls.size() > 1;
    // Large bodies are tested with their whole margin anyway.
    const bool in_cells = !bodies.is_static(i) && 2.0F * bodies.bounding_radius[i] <= large_radius_;
    fast_margin_.push_back(in_cells ? std::max(kMinSpeculativeMargin, bodies.bounding_radius[i])
                                    : std::numeric_limits<float>::infinity());
  }
}

float CollisionPipeline::travel_of(const BodyStore& bodies, std::size_t i) const {
  if (!bodies.is_active(i)) return 0.0F;
  float speed = bodies.velocity(i).norm();
  if (!bodies.is_sphere[i]) speed += bodies.angular_velocity(i).norm() * bodies.bounding_radius[i];
  return speed * dt_s_;
}

float CollisionPipeline::compute_query_radii(const BodyStore& bodies, std::span<const std::int32_t> own) {
  float max_travel = 0.0F;
  for (const std::int32_t i : own) {
    travel_[i] = travel_of(bodies, i);
    speculative_margin_[i] = std::max(kMinSpeculativeMargin, travel_[i]);
    max_travel = std::max(max_travel, travel_[i]);
    if (!bodies.is_sphere[i])
      half_extents_[i] = turned_extents(bodies.axes[i], bodies.shape[i]->half_extents);
    // Static bodies count as large: other bodies query them, and they do not query others.
    query_radius_[i] = bodies.is_static(i) ? 1e30F
                                           : bodies.bounding_radius[i] +
                                                 std::min(speculative_margin_[i], bodies.bounding_radius[i]);
  }
  return max_travel;
}

void CollisionPipeline::find_fast_bodies(const BodyStore& bodies) {
  fast_bodies_.clear();
  max_fast_length_ = 0.0F;
  // Two bodies close by twice the greatest travel at most; a fast body is one that moves by half of its
  // width.
  may_any_pass_ = 4.0F * std::ranges::max(max_travel_) > least_thickness_;
  if (!may_any_pass_) return;
  for (const std::int32_t i : grid_bodies_) {
    if (!is_fast(i) || !bodies.position[i].allFinite()) continue;
    const FastBody& f = fast_bodies_.emplace_back(fast_body(bodies, i));
    max_fast_length_ = std::max(max_fast_length_, f.high.x() - f.low.x());
  }
  std::ranges::stable_sort(fast_bodies_, {}, [](const FastBody& f) { return f.low.x(); });
}

CollisionPipeline::FastBody CollisionPipeline::fast_body(const BodyStore& bodies, std::size_t i) const {
  const Vec3 reach = Vec3::Constant(bodies.bounding_radius[i] + kMinSpeculativeMargin);
  const Vec3 from = bodies.position[i], to = from + dt_s_ * bodies.velocity(i);
  return {static_cast<std::int32_t>(i), from.cwiseMin(to) - reach, from.cwiseMax(to) + reach};
}

// Lists a fast body as a neighbour of all that its path may meet: the grid's search around its start would
// miss them.
void CollisionPipeline::find_fast_neighbours(const BodyStore& bodies) {
  const auto add_large = [&](std::int32_t l) {
    const Vec3 half = turned_extents(bodies.axes[l], bodies.shape[l]->half_extents) +
                      Vec3::Constant(speculative_margin_[l]);
    const Vec3 centre = bodies.origin(l);
    for_each_fast_in_box(centre - half, centre + half, 0, [&](std::int32_t fast) {
      large_neighbours_.push_back({fast, l});
    });
  };
  std::ranges::for_each(grid_->large_bodies(), add_large);
  std::ranges::for_each(sleeper_grid_.large_bodies(), add_large);
  for (std::size_t k = 0; k < fast_bodies_.size(); ++k) {
    const FastBody& f = fast_bodies_[k];
    grid_->for_each_in_box(f.low, f.high, [&](std::int32_t body) {
      if (!is_fast(body)) large_neighbours_.push_back({body, f.body});
    });
    for_each_fast_in_box(f.low, f.high, k + 1, [&](std::int32_t other) {
      large_neighbours_.push_back({other, f.body});
    });
    sleeper_grid_.for_each_in_box(f.low, f.high, [&](std::int32_t sleeper) {
      large_neighbours_.push_back({f.body, sleeper});
    });
  }
}

void CollisionPipeline::find_large_neighbours(const BodyStore& bodies) {
  if (large_neighbours_of_.size() != bodies.id.size())
    large_neighbours_of_.assign(bodies.id.size(), {0, 0});
  else
    for (const LargeNeighbour& n : large_neighbours_) large_neighbours_of_[n.body] = {0, 0};
  large_neighbours_.clear();
  const auto add_large = [&](std::int32_t l) {
    for_each_in_reach_of_large(bodies, *grid_, l, [&](std::int32_t body) {
      if (fast_bodies_.empty() || !is_fast(body)) large_neighbours_.push_back({body, l});
    });
  };
  std::ranges::for_each(grid_->large_bodies(), add_large);
  std::ranges::for_each(sleeper_grid_.large_bodies(), add_large);
  if (!fast_bodies_.empty()) find_fast_neighbours(bodies);
  std::stable_sort(large_neighbours_.begin(), large_neighbours_.end(),
                   [](const LargeNeighbour& a, const LargeNeighbour& b) { return a.body < b.body; });
  for (int k = 0; k < static_cast<int>(large_neighbours_.size()); ++k) {
    IndexRange& range = large_neighbours_of_[large_neighbours_[k].body];
    if (range.end == 0) range.begin = k;
    range.end = k + 1;
  }
}

// Solvers read the bodies that contacts and joints connect by their rows.
void CollisionPipeline::add_rows_of_sleepers(const BodyStore& bodies) {
  for (const SlabResults& results : slab_results_)
    for (const std::int32_t sleeper : results.touched_sleepers) partition_.add_row(sleeper);
  for (const BodyLink& link : bodies.links)
    for (const std::int32_t body : {link.a, link.b})
      if (body >= 0 && bodies.asleep[body]) partition_.add_row(body);
}

void CollisionPipeline::collide_slab(const BodyStore& bodies, int slab, SlabResults& results) {
  const auto begin = [](BodyRunOutput& output, const ContactList& list) {
    output.from = list.manifolds.size();
  };
  const auto end = [](BodyRunOutput& output, const ContactList& list) {
    output.count = list.manifolds.size() - output.from;
  };
  const auto contact_count = [&] {
    return results.pair_contacts.contacts.size() + results.static_contacts.contacts.size();
  };
  const std::size_t contacts_before = contact_count();
  results.end_of_pairs = results.pair_contacts.manifolds.size() + max_pairs_;
  for (const std::int32_t p : partition_.body_runs_of(slab)) {
    const Index i = p;
    begin(pair_output_[i], results.pair_contacts), begin(static_output_[i], results.static_contacts);
    if (slab + 1 == partition_.slab_count())
      collide_large_bodies(bodies, results);
    else
      collide_body_run(bodies, partition_.body_runs()[i], results);
    end(pair_output_[i], results.pair_contacts), end(static_output_[i], results.static_contacts);
  }
  results.contact_count = contact_count() - contacts_before;
}

// Appends what the slab has to the merged lists, while its own are those.
void CollisionPipeline::collide_slab_in_place(const BodyStore& bodies, int slab, SlabResults& results,
                                              ContactList& pair_contacts, ContactList& static_contacts) {
  const auto swap_lists = [&] {
    std::swap(results.pair_contacts.contacts, pair_contacts.contacts);
    std::swap(results.static_contacts.contacts, static_contacts.contacts);
    if (!finds_in_order_) return;
    std::swap(results.pair_contacts.manifolds, pair_contacts.manifolds);
    std::swap(results.static_contacts.manifolds, static_contacts.manifolds);
  };
  results.first_pair_contact = results.first_static_contact = 0;
  swap_lists();
  collide_slab(bodies, slab, results);
  swap_lists();
}

void CollisionPipeline::collide_body_run(const BodyStore& bodies, const SpatialPartition::BodyRun& run,
                                         SlabResults& results) const {
  for (int k = run.begin; k < run.end; ++k) {
    const Index i = grid_->body(k);
    collide_static(bodies, i, results);
    const IndexRange neighbours = large_neighbours_of_[i];
    for (int n = neighbours.begin; n < neighbours.end; ++n) {
      const Index large = large_neighbours_[n].large;
      if (!bodies.is_static(large)) collide_pair(bodies, i, large, results);
    }
    // The sleepers in the way of a fast body are among the neighbours above.
    if (!has_sleepers() || (!fast_bodies_.empty() && is_fast(i))) continue;
    const Vec3 half = Vec3::Constant(query_radius_[i]);
    const Vec3 low = bodies.position[i] - half, high = bodies.position[i] + half;
    if ((low.array() > sleepers_high_.array()).any() || (high.array() < sleepers_low_.array()).any())
      continue;
    sleeper_grid_.for_each_in_box(low, high, [&](std::int32_t j) {
      const float radius_sum = query_radius_[i] + query_radius_[j];
      if ((bodies.position[i] - bodies.position[j]).squaredNorm() < radius_sum * radius_sum)
        collide_pair(bodies, i, j, results);
    });
  }
  // The pairs of fast bodies are among the neighbours above.
  if (fast_bodies_.empty())
    grid_->for_each_pair(run.begin, run.end,
                         [&](std::int32_t i, std::int32_t j) { collide_pair(bodies, i, j, results); });
  else
    grid_->for_each_pair(run.begin, run.end, [&](std::int32_t i, std::int32_t j) {
      if (!is_fast(i) && !is_fast(j)) collide_pair(bodies, i, j, results);
    });
}

void CollisionPipeline::collide_large_bodies(const BodyStore& bodies, SlabResults& results) const {
  const auto large = grid_->large_bodies();
  for (std::size_t k = 0; k < large.size(); ++k) {
    const Index i = large[k];
    if (bodies.is_static(i)) continue;
    collide_static(bodies, i, results);
    for (std::size_t other = k + 1; other < large.size(); ++other) {
      const Index j = large[other];
      if (!bodies.is_static(j)) collide_pair(bodies, i, j, results);
    }
    if (!has_sleepers()) continue;
    const auto collide = [&](std::int32_t sleeper) { collide_pair(bodies, i, sleeper, results); };
    for_each_in_reach_of_large(bodies, sleeper_grid_, i, collide);
    std::ranges::for_each(sleeper_grid_.large_bodies(), collide);
  }
}

void CollisionPipeline::collide_static(const BodyStore& bodies, std::size_t i, SlabResults& results) const {
  ContactList& out = results.static_contacts;
  const auto first = static_cast<std::int32_t>(out.contacts.size());
  const Vec3 centre = bodies.origin(i);
  const float margin = std::max(kMinSpeculativeMargin, speculative_margin_[i] + field_.max_speed * dt_s_);
  if (bodies.is_sphere[i] && !collider_.free_layout())
    collide_sphere_with_field(field_, centre, bodies.bounding_radius[i], margin, out.contacts);
  else if (collider_.free_layout() || field_.has_contacts_per_cell() || bodies.rolls_unevenly[i])
    collider_.collide_columns(*bodies.shape[i], centre, bodies.axes[i], margin, out.contacts);
  else
    field_cache_.collide(bodies, i, margin, results.cached_field, out.contacts);
  const std::size_t field_contacts = out.contacts.size() - static_cast<std::size_t>(first);
  if (collider_.has_skin_or_tips())
    collider_.collide_skin_or_tips(*bodies.shape[i], centre, bodies.axes[i], margin, out.contacts);
  if (centre.z() - bodies.bounding_radius[i] - margin < ground_height_)
    collide_shape_with_ground(*bodies.shape[i], centre, bodies.axes[i], ground_height_, margin, out.contacts);
  const bool in_cells = query_radius_[i] <= large_radius_;
  if (!in_cells || large_neighbours_of_[i].begin < large_neighbours_of_[i].end)
    collide_static_bodies(bodies, i, results);
  const auto count = static_cast<std::int32_t>(out.contacts.size()) - first;
  if (count == 0) return;
  out.manifolds.push_back({static_cast<std::int32_t>(i), Manifold::kStatic, first, count});
  anchor_at_centre_of_mass(bodies, i, out.contacts, first);
  match_contacts(out, out.manifolds.back(), previous_contacts_.static_contacts(),
                 previous_contacts_.find_static(i, results.member), 0.15F * bodies.bounding_radius[i]);
  if (field_contacts > 1 && !bodies.is_sphere[i]) find_support(bodies, i, margin, field_contacts, results);
}

// Finds the support patch of the last manifold's body. The patch takes over the load and the friction of the
// manifold's first `field_contacts`, those with columns of the field.
void CollisionPipeline::find_support(const BodyStore& bodies, std::size_t i, float margin,
                                     std::size_t field_contacts, SlabResults& results) const {
  SupportPatches& supports = *results.supports;
  Manifold& manifold = results.static_contacts.manifolds.back();
  std::vector<Contact>& list = results.static_contacts.contacts;
  const auto contacts = std::span(list).subspan(manifold.first, field_contacts);
  if (!add_support_patch(field_, collider_.free_layout(), *bodies.shape[i], static_cast<std::int32_t>(i),
                         bodies.position[i], bodies.origin(i), bodies.axes[i], margin, contacts, supports))
    return;
  SupportPatch& patch = supports.patches.back();
  if (patch.has_shares)
    remove_points_without_share(supports, [&](std::int32_t k) {
      list.erase(list.begin() + manifold.first + k);
      --manifold.count;
    });
  for (int k = patch.first_point; k < patch.first_point + patch.point_count; ++k) {
    const Index point = supports.points[k];
    contacts[point].partner = patch.is_elastic ? Partner::kElasticTop : Partner::kSupportedCell;
    if (patch.is_elastic) contacts[point].normal_impulse = 0.0F;
  }
  const SupportReference from = previous_support_of_body_[i];
  if (from.slab < 0) return;
  const SupportPatches& previous = previous_supports_[from.slab];
  match_support_patch(previous, previous.patches[from.patch], supports, patch);
}

// The static bodies near a body. What it meets in the course of the step is found where it meets the first of
// them; what would be hit later is left to later steps, because the first impact changes its path.
void CollisionPipeline::collide_static_bodies(const BodyStore& bodies, std::size_t i,
                                              SlabResults& results) const {
  thread_local std::vector<StaticNeighbour> near;
  near.clear();
  const auto add = [&](std::int32_t other) {
    if (bodies.is_static(other) && bodies.may_touch(i, other))
      near.push_back({.body = static_cast<std::size_t>(other)});
  };
  if (query_radius_[i] <= large_radius_)
    for (int n = large_neighbours_of_[i].begin; n < large_neighbours_of_[i].end; ++n)
      add(large_neighbours_[n].large);
  else
    std::ranges::for_each(grid_->large_bodies(), add);
  if (near.empty()) return;
  float first_impact_s = PairSweep::kNever;
  for (StaticNeighbour& n : near) {
    if (!may_any_pass_ || (!may_pass(i, n.body) && !is_fast(i))) continue;
    n.is_swept = true;
    results.swept_pairs.emplace_back(static_cast<std::int32_t>(i), static_cast<std::int32_t>(n.body));
    n.impact_s = PairSweep(bodies, i, n.body, dt_s_).time_of_impact();
    first_impact_s = std::min(first_impact_s, n.impact_s);
  }
  std::vector<Contact>& contacts = results.static_contacts.contacts;
  const std::size_t first = contacts.size();
  for (StaticNeighbour& n : near) {
    if (n.is_swept && n.impact_s != PairSweep::kNever &&
        (n.impact_s - first_impact_s) * travel_[i] > kMinSpeculativeMargin * dt_s_)
      n.impact_s = PairSweep::kNever;
    if (n.impact_s == PairSweep::kNever) n.impact_s = 0.0F;
    collide_static_body(bodies, i, n, results);
  }
  if (contacts.size() == first) return;
  correct_internal_edges(bodies, i, near, contacts);
  for (const StaticNeighbour& n : near)
    if (n.impact_s > 0.0F)
      PairSweep(bodies, i, n.body, dt_s_)
          .move_to_start(n.impact_s, std::span(contacts).subspan(n.first, n.end - n.first));
  erase_marked(contacts, first);
}

void CollisionPipeline::collide_static_body(const BodyStore& bodies, std::size_t i, StaticNeighbour& other,
                                            SlabResults& results) const {
  std::vector<Contact>& contacts = results.static_contacts.contacts;
  other.first = contacts.size();
  if (other.is_swept)
    PairSweep(bodies, i, other.body, dt_s_).collide_at(other.impact_s, kMinSpeculativeMargin, contacts);
  else
    collide_bodies(bodies, i, other.body, speculative_margin_[i], dt_s_,
                   previous_contacts_.find_static_normal(i, other.body, results.member), contacts);
  other.end = contacts.size();
  for (std::size_t k = other.first; k < other.end; ++k)
    contacts[k].partner = Partner{static_cast<std::int32_t>(other.body)};
}

void CollisionPipeline::correct_internal_edges(const BodyStore& bodies, std::size_t i,
                                               std::span<const StaticNeighbour> near,
                                               std::vector<Contact>& contacts) const {
  thread_local std::vector<Solid> solids;
  thread_local std::vector<SeamContact> seam;
  solids.clear(), seam.clear();
  for (const StaticNeighbour& n : near) {
    solids.push_back({*bodies.shape[n.body], bodies.origin(n.body), bodies.axes[n.body]});
    const Vec3 origin =
        n.impact_s > 0.0F ? PairSweep(bodies, i, n.body, dt_s_).origin_of_a(n.impact_s) : bodies.origin(i);
    for (std::size_t k = n.first; k < n.end; ++k) seam.push_back({&contacts[k], origin});
  }
  const float radius = bodies.is_sphere[i] ? bodies.bounding_radius[i] : 0.0F;
  if (may_have_internal_edges(solids)) mark_internal_edges(solids, true, radius, seam);
}

void CollisionPipeline::collide_pair(const BodyStore& bodies, std::size_t i, std::size_t j,
                                     SlabResults& results) const {
  ++results.tested_pairs;
  if (!bodies.may_touch(i, j)) return;
  const std::size_t a = std::min(i, j), b = std::max(i, j);
  const bool has_sphere = bodies.is_sphere[a] || bodies.is_sphere[b];
  ContactList& pair_contacts = results.pair_contacts;
  if (pair_contacts.manifolds.size() >= results.end_of_pairs) {
    results.overloaded = true;
    return;
  }
  const auto first = static_cast<std::int32_t>(pair_contacts.contacts.size());
  PairManifoldCache::Points points;
  const bool is_swept =
      may_any_pass_ && ((!fast_bodies_.empty() && (is_fast(a) || is_fast(b))) || may_pass(a, b));
  if (is_swept) {
    collide_swept_pair(bodies, a, b, results);
  } else if (has_sphere || bodies.rolls_unevenly[a] || bodies.rolls_unevenly[b]) {
    collide_bodies(bodies, a, b, kMinSpeculativeMargin, dt_s_, nullptr, pair_contacts.contacts);
  } else {
    const Vec3 gap =
        (bodies.position[a] - bodies.position[b]).cwiseAbs() - half_extents_[a] - half_extents_[b];
    const float separation = gap.maxCoeff();
    // Bodies close by less than they travel; the allowance is for rounding.
    constexpr float kRoundingFactor = 1.001F, kRounding = 1e-3F;
    const float greatest_margin =
        kMinSpeculativeMargin + kRoundingFactor * (travel_[a] + travel_[b]) + kRounding;
    if (separation > greatest_margin + PairManifoldCache::kHorizon) return;
    const float margin = kMinSpeculativeMargin + closing_distance(bodies, a, b, dt_s_);
    if (separation > margin + PairManifoldCache::kHorizon) return;
    points = pair_cache_.collide(bodies, a, b, margin, results.cached_pairs, pair_contacts.contacts);
  }
  // Kept manifolds are corrected when they are made.
  if (any_compound_ && !is_swept && (has_sphere || bodies.rolls_unevenly[a] || bodies.rolls_unevenly[b]))
    world::correct_internal_edges({*bodies.shape[a], bodies.origin(a), bodies.axes[a]},
                                  {*bodies.shape[b], bodies.origin(b), bodies.axes[b]},
                                  pair_contacts.contacts, first);
  const auto count = static_cast<std::int32_t>(pair_contacts.contacts.size()) - first;
  if (count == 0) return;
  pair_contacts.manifolds.push_back(
      {static_cast<std::int32_t>(a), static_cast<std::int32_t>(b), first, count});
  for (const std::size_t body : {a, b})
    if (bodies.asleep[body]) results.touched_sleepers.push_back(static_cast<std::int32_t>(body));
  anchor_at_centre_of_mass(bodies, a, pair_contacts.contacts, first);
  // A sphere has a single contact per partner, whose anchor may move far in one step.
  const float tolerance = has_sphere ? bodies.bounding_radius[a] : 0.15F * bodies.bounding_radius[a];
  const ContactList& previous = previous_contacts_.pair_contacts();
  const int known = previous_contacts_.find_pair(a, b, results.member, results.expected_pair);
  const Manifold& manifold = pair_contacts.manifolds.back();
  if (known < 0 || !match_points(pair_contacts.contacts_of(manifold),
                                 previous.contacts_of(previous.manifolds[known]), points, tolerance))
    match_contacts(pair_contacts, manifold, previous, known, tolerance);
}

void CollisionPipeline::collide_swept_pair(const BodyStore& bodies, std::size_t a, std::size_t b,
                                           SlabResults& results) const {
  const PairSweep sweep(bodies, a, b, dt_s_);
  const float reach =
      bodies.bounding_radius[a] + bodies.bounding_radius[b] + sweep.travel() + kMinSpeculativeMargin;
  if ((bodies.position[a] - bodies.position[b]).squaredNorm() > reach * reach) return;
  results.swept_pairs.emplace_back(static_cast<std::int32_t>(a), static_cast<std::int32_t>(b));
  std::vector<Contact>& contacts = results.pair_contacts.contacts;
  const float impact_s = sweep.time_of_impact(), at_s = impact_s == PairSweep::kNever ? 0.0F : impact_s;
  const std::size_t first = contacts.size();
  sweep.collide_at(at_s, kMinSpeculativeMargin, contacts);
  sweep.correct_internal_edges(at_s, contacts, first);
  sweep.move_to_start(at_s, std::span(contacts).subspan(first));
}

// As assign_output_offsets(), where a single member has found the manifolds in order.
void CollisionPipeline::set_ranges(const std::vector<BodyRunOutput>& outputs, SlabRanges& ranges) const {
  ranges.range.clear();
  for (const BodyRunOutput& output : outputs)
    ranges.range.push_back({static_cast<int>(output.from), static_cast<int>(output.from + output.count)});
  ranges.manifold_count = outputs.empty() ? 0 : outputs.back().from + outputs.back().count;
  ranges.first_range.clear();
  for (int s = 0; s <= partition_.slab_count(); ++s)
    ranges.first_range.push_back(static_cast<std::int32_t>(partition_.first_body_run_of(s)));
}

// Assigns the offsets of the body runs' manifolds in grid order, independent of slabs and members.
void CollisionPipeline::assign_output_offsets(std::vector<BodyRunOutput>& outputs, ContactList& list,
                                              SlabRanges& ranges) const {
  std::size_t offset = 0;
  for (BodyRunOutput& output : outputs) {
    output.to = offset;
    offset += output.count;
  }
  list.manifolds.resize(offset);
  ranges.manifold_count = offset;
  ranges.range.resize(outputs.size());
  ranges.first_range.clear();
  for (int s = 0; s <= partition_.slab_count(); ++s)
    ranges.first_range.push_back(static_cast<std::int32_t>(partition_.first_body_run_of(s)));
}

// Contacts lie slab by slab, as a single member finds them.
void CollisionPipeline::assign_contact_offsets(ContactList& pair_contacts, ContactList& static_contacts) {
  std::size_t pairs = 0, statics = 0;
  for (int s = 0; s < partition_.slab_count(); ++s) {
    SlabResults& results = slab_results_[s];
    results.first_pair_contact = static_cast<std::int32_t>(pairs);
    results.first_static_contact = static_cast<std::int32_t>(statics);
    pairs += results.pair_contacts.contacts.size();
    statics += results.static_contacts.contacts.size();
  }
  pair_contacts.contacts.resize(pairs);
  static_contacts.contacts.resize(statics);
}

void CollisionPipeline::merge_slab(int slab, const std::vector<BodyRunOutput>& outputs,
                                   const ContactList& list, std::int32_t first_contact, ContactList& to_list,
                                   SlabRanges& ranges) const {
  std::size_t run = partition_.first_body_run_of(slab);
  for (const std::int32_t p : partition_.body_runs_of(slab)) {
    const auto& [from, to, count] = outputs[p];
    for (std::size_t k = 0; k < count; ++k) {
      const Manifold& m = list.manifolds[from + k];
      to_list.manifolds[to + k] = {m.a, m.b, m.first + first_contact, m.count};
    }
    ranges.range[run++] = {static_cast<int>(to), static_cast<int>(to + count)};
  }
  // Contact is trivially copyable in effect, but Eigen's copy constructors hide that from the compiler.
  if (!list.contacts.empty())
    std::memcpy(static_cast<void*>(&to_list.contacts[first_contact]),
                static_cast<const void*>(list.contacts.data()), list.contacts.size() * sizeof(Contact));
}

}  // namespace smartsurf::world

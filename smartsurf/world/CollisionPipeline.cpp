#include "smartsurf/world/CollisionPipeline.h"

#include <algorithm>
#include <cstring>
#include <limits>
#include <numeric>
#include <span>

namespace smartsurf::world {

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
    if (std::ssize(contacts_per_slab_) == partition_.slab_count())
      partition_.set_contact_counts(contacts_per_slab_);
  });
}

std::span<const std::int32_t> CollisionPipeline::own_bodies(const Member& member) const {
  if (member.member_count > 1 && partition_.row_count() == std::ssize(body_indices_))
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
  slab_queue_.reset(member_count);
  // Several members replace all contacts: those that are there already need not be made again.
  if (member_count == 1) pair_contacts.clear(), static_contacts.clear();
  max_pairs_ = kMaxPairsPerBody * body_count;
  const std::size_t slabs = partition_.slab_count();
  if (slab_results_.size() < slabs) slab_results_.resize(slabs);
  for (std::size_t s = 0; s < slab_results_.size(); ++s) {
    slab_results_[s].overloaded = slab_results_[s].has_flat_pair = false;
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
  const std::size_t slabs = partition_.slab_count();
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
    if (bodies.non_spheres > 0) field_cache_.build_index(bodies.size());
  }
  if (member.is_caller() && bodies.non_spheres > 0) pair_cache_.build_index(bodies.size());
  partition_.assign_rows(bodies, *grid_, member);
  member.arrive_and_wait();
  const IndexRange own_slabs = partition_.share(member);
  previous_contacts_.set_own_slabs(own_slabs, member);
  const auto share_of = [&](int m) { return partition_.share({m, member.member_count, member.barrier}); };
  for (int s; (s = slab_queue_.take(member.index, share_of)) >= 0;) {
    SlabResults& results = slab_results_[s];
    results.member = member.index;
    const auto swap_lists = [&] {
      std::swap(results.pair_contacts, pair_contacts), std::swap(results.static_contacts, static_contacts);
    };
    if (member.member_count == 1) swap_lists();
    collide_slab(bodies, s, results);
    if (member.member_count == 1) swap_lists();
    if (results.overloaded) break;
  }
  member.single([&] {
    overloaded_ = std::ranges::any_of(slab_results_, &SlabResults::overloaded);
    any_flat_pair_ = std::ranges::any_of(slab_results_, &SlabResults::has_flat_pair);
    swept_pairs_ = 0;
    for (const SlabResults& r : slab_results_) swept_pairs_ += static_cast<int>(r.swept_pairs.size());
    if (overloaded_) {
      pair_contacts.clear();
      static_contacts.clear();
      return;
    }
    find_slab_ranges();
    if (member.member_count > 1) make_room(pair_contacts, static_contacts);
    if (partition_.slab_count() > 2) update_slab_weights();
    if (has_sleepers()) add_rows_of_sleepers(bodies);
  });
  if (overloaded_ || member.member_count == 1) return;
  for (int s = own_slabs.begin; s < own_slabs.end; ++s) {
    const SlabResults& results = slab_results_[s];
    merge(results.pair_contacts, pair_ranges_.first[s], results.first_pair_contact, pair_contacts);
    merge(results.static_contacts, static_ranges_.first[s], results.first_static_contact, static_contacts);
  }
}

void CollisionPipeline::archive(common::StateArchive& a, int bodies) {
  // The last slabs may be empty, of an earlier step that had more: they are not state.
  const auto last =
      std::find_if(slab_results_.rbegin(), slab_results_.rend(), [](const SlabResults& results) {
        return !results.cached_pairs.manifolds.empty() || !results.cached_field.manifolds.empty();
      });
  const auto slabs = a.value(static_cast<std::uint64_t>(last.base() - slab_results_.begin()));
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

// Solvers read the bodies that contacts and joints connect by their rows.
void CollisionPipeline::add_rows_of_sleepers(const BodyStore& bodies) {
  for (const SlabResults& results : slab_results_)
    for (const std::int32_t sleeper : results.touched_sleepers) partition_.add_row(sleeper);
  for (const BodyLink& link : bodies.links)
    for (const std::int32_t body : {link.a, link.b})
      if (body >= 0 && bodies.asleep[body]) partition_.add_row(body);
}

void CollisionPipeline::find_slab_ranges() {
  const auto begin = [](SlabRanges& ranges) { ranges.first.assign(1, 0); };
  const auto add = [](SlabRanges& ranges, std::size_t count) {
    ranges.first.push_back(ranges.first.back() + static_cast<std::int32_t>(count));
  };
  begin(pair_ranges_), begin(static_ranges_);
  for (int s = 0; s < partition_.slab_count(); ++s)
    add(pair_ranges_, slab_results_[s].pair_count), add(static_ranges_, slab_results_[s].static_count);
}

void CollisionPipeline::make_room(ContactList& pair_contacts, ContactList& static_contacts) {
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
  pair_contacts.manifolds.resize(pair_ranges_.manifold_count());
  static_contacts.manifolds.resize(static_ranges_.manifold_count());
}

void CollisionPipeline::merge(const ContactList& from, std::int32_t first_manifold,
                              std::int32_t first_contact, ContactList& to) {
  for (const Manifold& m : from.manifolds)
    to.manifolds[first_manifold++] = {m.a, m.b, m.first + first_contact, m.count};
  // Contact is trivially copyable in effect, but Eigen's copy constructors hide that from the compiler.
  if (!from.contacts.empty())
    std::memcpy(static_cast<void*>(&to.contacts[first_contact]),
                static_cast<const void*>(from.contacts.data()), from.contacts.size() * sizeof(Contact));
}

}  // namespace smartsurf::world

// Finds all contacts of a step, in a broad and a narrow phase: bodies against the field, the ground, static
// bodies and each other.
//
// In each step the members of a team call update_broadphase() and find_contacts() together. Members work on
// whole slabs of the partition; contact lists are merged in grid order, so they do not depend on the number
// of threads.
#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "smartsurf/surface/Field.h"
#include "smartsurf/world/body/BodyStore.h"
#include "smartsurf/world/broadphase/SpatialPartition.h"
#include "smartsurf/world/broadphase/UniformGrid.h"
#include "smartsurf/world/contact/Contact.h"
#include "smartsurf/world/contact/PreviousContacts.h"
#include "smartsurf/world/field/FieldCollider.h"
#include "smartsurf/world/field/FieldManifoldCache.h"
#include "smartsurf/world/field/SupportPatch.h"
#include "smartsurf/world/narrowphase/PairManifoldCache.h"
#include "smartsurf/world/parallel/Team.h"

namespace smartsurf::world {

class CollisionPipeline {
 public:
  // `ground`: height of the infinite ground plane, u, or −infinity for none. `field` must outlive the
  // pipeline.
  CollisionPipeline(const surface::Field& field, float dt_s, float ground)
      : field_(field), dt_s_(dt_s), ground_height_(ground), collider_(field), field_cache_(field) {}

  // Computes query radii, rebuilds the grid and cuts it into slabs. Called first in a step, by all members.
  void update_broadphase(const BodyStore&, const Member&);
  // Calls found(other) for every non-static body that `body` may touch in this step.
  template <class Found>
  void for_each_nearby(const BodyStore&, std::size_t body, Found found) const;
  // Calls found(fast, other) for the bodies that fly farther than their own size in this step, and every
  // other non-static body that may be in their way.
  template <class Found>
  void for_each_in_way(const BodyStore&, Found found) const;

  // The bodies of a member: those in its slabs in the previous step, which are still in its cache, or an even
  // share by index if there is no previous step. Every body belongs to exactly one member.
  std::span<const std::int32_t> own_bodies(const Member&) const;

  // Replaces the contacts of the previous step in the lists by those of this step, for all active bodies, and
  // copies the impulses of matching contacts. The order of the contacts depends on the bodies only. Called by
  // all members, which must pass a barrier before they read the lists. The lists are empty if
  // is_overloaded().
  void find_contacts(const BodyStore&, ContactList& pair_contacts, ContactList& static_contacts,
                     const Member&);
  // True if more pairs touched in the last find_contacts() than solids can (kMaxPairsPerBody): they would
  // take time and memory without bound. Members may read it after find_contacts().
  bool is_overloaded() const { return overloaded_; }

  // The partition of the last update_broadphase(), and the range of each slab's manifolds in the lists of the
  // last find_contacts().
  const SpatialPartition& partition() const { return partition_; }
  const SlabRanges& pair_ranges() const { return pair_ranges_; }
  const SlabRanges& static_ranges() const { return static_ranges_; }
  // The support patches of the last find_contacts(), one list per slab of the partition.
  std::span<SupportPatches> supports() { return std::span(supports_).first(support_slabs_); }
  std::span<const SupportPatches> supports() const { return std::span(supports_).first(support_slabs_); }
  // Calls visit(a, b) for the pairs of bodies, b may be static, that were swept in the last find_contacts().
  template <class Visit>
  void for_each_swept_pair(Visit visit) const {
    for (const SlabResults& results : slab_results_)
      for (const auto& [a, b] : results.swept_pairs)
        visit(static_cast<std::size_t>(a), static_cast<std::size_t>(b));
  }
  // Least width of a part of either body, u.
  float thinner_width(std::size_t a, std::size_t b) const { return std::min(thickness_[a], thickness_[b]); }
  // Call when no find_contacts() follows in a step, because no body is active.
  void clear_supports() { support_slabs_ = 0; }
  // Call before the body is removed.
  void on_body_removed(std::int32_t body) {
    for (SupportPatches& patches : supports_) remove_body(patches, body);
  }

  const FieldCollider& field_collider() const { return collider_; }

  // Must be called after each single addition or removal of a body: resizes the buffers and drops the
  // manifold caches, whose body indices are no longer valid. `bodies`: the new number of bodies.
  void on_bodies_changed(int bodies) {
    large_radius_ = -1.0F;
    body_indices_.resize(bodies);
    if (bodies > 0) body_indices_.back() = bodies - 1;
    for (SlabResults& f : slab_results_) f.cached_pairs = {}, f.cached_field = {};
  }

  // Contacts and manifolds are state: they warm-start the next step. `bodies`: the number of bodies of the
  // state.
  void archive(common::StateArchive&, int bodies);

 private:
  // Each of equal spheres touches at most twelve others, and the smaller of two unequal ones has few larger
  // neighbours. That makes six pairs per body, and some more within the margin.
  static constexpr std::size_t kMaxPairsPerBody = 64;
  struct LargeNeighbour {
    std::int32_t body, large;
  };
  // A body that may move farther in this step than by its own bounding radius. The grid knows it by where it
  // starts; what lies in its way is looked for in this box.
  struct FastBody {
    std::int32_t body;
    Vec3 low, high;
  };
  // A static body near a body, and its contacts in the slab's list.
  struct StaticNeighbour {
    std::size_t body;
    bool is_swept = false;
    float impact_s = 0.0F;  // when a swept pair first touches; 0 if it does not
    std::size_t first = 0, end = 0;
  };
  // Contacts found in one slab.
  struct SlabResults {
    int member = 0;  // the member that processes the slab
    bool overloaded = false;
    int expected_pair = 0;  // see PreviousContacts::find_pair
    SupportPatches* supports = nullptr;
    ContactList pair_contacts, static_contacts;
    std::vector<std::pair<std::int32_t, std::int32_t>> swept_pairs;
    PairManifoldCache::ChunkCache cached_pairs;
    FieldManifoldCache::ChunkCache cached_field;
  };
  struct ContactCounts {
    std::size_t manifolds = 0, contacts = 0;
  };
  // Output of one body run: its offset in the slab's list and in the merged list, and its size.
  struct BodyRunOutput {
    ContactCounts from, to, count;
  };

  void compute_large_radius(const BodyStore&);
  void measure_bodies(const BodyStore&);
  // Returns the greatest travel.
  float compute_query_radii(const BodyStore&, std::span<const std::int32_t> own);
  bool is_fast(std::size_t body) const { return speculative_margin_[body] > fast_margin_[body]; }
  void find_fast_bodies(const BodyStore&);
  template <class Found>
  void for_each_fast_in_box(const Vec3& low, const Vec3& high, std::size_t from, Found found) const;
  void find_fast_neighbours(const BodyStore&);
  void begin_detection(ContactList& pair_contacts, ContactList& static_contacts, int member_count,
                       int body_count);
  void find_large_neighbours(const BodyStore&);
  void swap_supports(int bodies);
  void find_support(const BodyStore&, std::size_t body, float margin, std::size_t field_contacts,
                    SlabResults& results) const;
  void collide_slab(const BodyStore&, int slab, SlabResults& results);
  void collide_body_run(const BodyStore&, const SpatialPartition::BodyRun&, SlabResults& results) const;
  void collide_large_bodies(const BodyStore&, SlabResults& results) const;
  void collide_static(const BodyStore&, std::size_t body, SlabResults& results) const;
  void collide_static_bodies(const BodyStore&, std::size_t body, SlabResults& results) const;
  void collide_static_body(const BodyStore&, std::size_t body, StaticNeighbour&, SlabResults& results) const;
  void correct_internal_edges(const BodyStore&, std::size_t body, std::span<const StaticNeighbour>,
                              std::vector<Contact>&) const;
  // Whether the bodies may close more than half of the thinner one's width in this step.
  bool may_pass(std::size_t a, std::size_t b) const {
    return travel_[a] + travel_[b] > 0.5F * std::min(thickness_[a], thickness_[b]);
  }
  void collide_pair(const BodyStore&, std::size_t i, std::size_t j, SlabResults& results) const;
  void collide_swept_pair(const BodyStore&, std::size_t a, std::size_t b, SlabResults& results) const;
  void assign_output_offsets(std::vector<BodyRunOutput>&, ContactList&, SlabRanges&) const;
  void update_slab_weights();
  void merge_slab(int slab, const std::vector<BodyRunOutput>&, const ContactList& from, ContactList& to,
                  SlabRanges&) const;

  const surface::Field& field_;
  float dt_s_, ground_height_;
  FieldCollider collider_;
  float large_radius_ = -1.0F;  // bodies with a larger query radius stay outside the grid's cells; < 0: stale
  UniformGrid* grid_ = nullptr;  // of the thread that steps, from update_broadphase() to the end of the step
  SpatialPartition partition_;
  std::vector<float> query_radius_, speculative_margin_;
  std::vector<float> travel_;  // of any point of the body in this step, u; 0 for one that is not active
  // By body: least width of its parts, and the speculative margin from which the body is fast, infinity for
  // bodies outside the grid's cells, u.
  std::vector<float> thickness_, fast_margin_;
  std::vector<float> max_travel_;           // by member of the team, u
  float least_thickness_ = 0.0F;            // of all bodies, u
  bool any_compound_ = false;               // whether any body has several parts
  bool may_any_pass_ = false;               // false: no two bodies can pass each other in this step
  std::vector<FastBody> fast_bodies_;       // ascending by low.x
  float max_fast_length_ = 0.0F;            // of their boxes along x, u
  std::vector<Vec3> half_extents_;          // of a non-sphere's bounding box in world axes, u
  std::vector<std::int32_t> body_indices_;  // 0, 1, …, bodies − 1
  std::vector<LargeNeighbour> large_neighbours_;
  std::vector<std::int32_t> first_large_neighbour_;  // indexed by body: first entry in large_neighbours_
  PreviousContacts previous_contacts_;
  std::vector<SlabResults> slab_results_;                     // one per slab
  std::vector<SupportPatches> supports_, previous_supports_;  // one per slab
  std::size_t max_pairs_ = 0;                                 // in one slab, in this step
  bool overloaded_ = false;
  std::size_t support_slabs_ = 0;  // number of lists of this step in supports_
  struct SupportReference {
    std::int32_t slab, patch;  // slab < 0: none
  };
  std::vector<SupportReference> previous_support_of_body_;  // empty if there was no patch
  std::vector<BodyRunOutput> pair_output_, static_output_;  // one per body run
  SlabRanges pair_ranges_, static_ranges_;
  std::vector<std::size_t> contacts_per_slab_;  // in the last find_contacts()
  PairManifoldCache pair_cache_;
  FieldManifoldCache field_cache_;
};

template <class Found>
void CollisionPipeline::for_each_nearby(const BodyStore& bodies, std::size_t body, Found found) const {
  auto test = [&](std::int32_t other) {
    const auto j = static_cast<std::size_t>(other);
    if (j == body || bodies.is_static(j)) return;
    const float radius_sum = query_radius_[body] + query_radius_[j];
    if ((bodies.position[body] - bodies.position[j]).squaredNorm() < radius_sum * radius_sum) found(j);
  };
  const Vec3 half = Vec3::Constant(query_radius_[body]);
  grid_->for_each_in_box(bodies.position[body] - half, bodies.position[body] + half, test);
  for (const std::int32_t large : grid_->large_bodies()) test(large);
}

template <class Found>
void CollisionPipeline::for_each_fast_in_box(const Vec3& low, const Vec3& high, std::size_t from,
                                             Found found) const {
  const auto begin = fast_bodies_.begin() + static_cast<std::ptrdiff_t>(from);
  const auto first = std::ranges::lower_bound(begin, fast_bodies_.end(), low.x() - max_fast_length_, {},
                                              [](const FastBody& f) { return f.low.x(); });
  for (auto f = first; f != fast_bodies_.end() && f->low.x() <= high.x(); ++f)
    if ((f->low.array() <= high.array()).all() && (f->high.array() >= low.array()).all()) found(f->body);
}

template <class Found>
void CollisionPipeline::for_each_in_way(const BodyStore& bodies, Found found) const {
  for (const FastBody& f : fast_bodies_) {
    const Index i = f.body;
    const Vec3 path = dt_s_ * bodies.velocity(i);
    const float length = std::max(path.squaredNorm(), 1e-20F);
    const auto test = [&](std::int32_t other) {
      const Index j = other;
      if (j == i || bodies.is_static(j)) return;
      const Vec3 offset = bodies.position[j] - bodies.position[i];
      const float along = std::clamp(offset.dot(path) / length, 0.0F, 1.0F),
                  reach = bodies.bounding_radius[i] + query_radius_[j];
      if ((offset - along * path).squaredNorm() < reach * reach) found(i, j);
    };
    grid_->for_each_in_box(f.low, f.high, test);
    for (const std::int32_t large : grid_->large_bodies()) test(large);
  }
}

}  // namespace smartsurf::world

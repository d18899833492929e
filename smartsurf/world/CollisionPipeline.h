// Finds all contacts of a step, in a broad and a narrow phase: bodies against the field, the ground, static
// bodies and each other.
//
// In each step the members of a team call update_broadphase() and find_contacts() together. Members work on
// whole slabs of the partition; contact lists are in the order of the slabs, so they do not depend on the
// number of threads.
//
// Sleepers are in a grid of their own, which stays as it is until a body falls asleep or wakes. A step costs
// what the bodies in the other grid cost, and those sleepers that they touch.
#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "smartsurf/surface/Field.h"
#include "smartsurf/world/Substeps.h"
#include "smartsurf/world/body/BodyMap.h"
#include "smartsurf/world/body/BodyStore.h"
#include "smartsurf/world/broadphase/SpatialPartition.h"
#include "smartsurf/world/broadphase/UniformGrid.h"
#include "smartsurf/world/contact/Contact.h"
#include "smartsurf/world/contact/PreviousContacts.h"
#include "smartsurf/world/field/FieldCollider.h"
#include "smartsurf/world/field/FieldManifoldCache.h"
#include "smartsurf/world/field/SupportPatch.h"
#include "smartsurf/world/narrowphase/PairManifoldCache.h"
#include "smartsurf/world/parallel/SlabQueue.h"
#include "smartsurf/world/parallel/Team.h"

namespace smartsurf::world {

class CollisionPipeline {
 public:
  // `ground`: height of the infinite ground plane, u, or −infinity for none. `gravity`: u/s². `field` must
  // outlive the pipeline.
  CollisionPipeline(const surface::Field& field, float dt_s, int substeps, float ground, float gravity)
      : field_(field),
        dt_s_(dt_s),
        substep_s_(dt_s / static_cast<float>(substeps)),
        mean_substep_start_s_(mean_substep_start(dt_s, substeps)),
        ground_height_(ground),
        gravity_(gravity),
        collider_(field),
        field_cache_(field) {}

  // Takes over the set of sleepers, unless `version` and the bodies are those of the last call. Called by one
  // thread before the other functions, in each step in which bodies may have fallen asleep or woken.
  void update_sleepers(const BodyStore&, unsigned version);
  // Calls found(sleeper) for every sleeper that `body`, which is awake, may touch in this step.
  template <class Found>
  void for_each_sleeper_in_reach(const BodyStore&, std::size_t body, Found found) const;
  // Computes query radii, rebuilds the grid of the bodies that do not sleep and cuts it into slabs. Called by
  // all members.
  void update_broadphase(const BodyStore&, const Member&);

  // True if nothing but the body `partner` comes within `reach` of the body's bounding sphere in the step.
  bool has_room(const BodyStore&, std::size_t body, std::int32_t partner, float reach) const;

  // The bodies of a member: those in its slabs in the previous step, which are still in its cache, or an even
  // share by index if there is no previous step. Every body belongs to exactly one member.
  std::span<const std::int32_t> own_bodies(const Member&) const;
  // The bodies that do not sleep, static ones included, ascending, and the pairs of bodies that the narrow
  // phase tested in the last step: what the step cost.
  std::span<const std::int32_t> bodies_in_grid() const { return grid_bodies_; }
  std::size_t tested_pairs() const;

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
  // A list of patches of the previous step, to which those of woken bodies may be added before
  // update_broadphase().
  SupportPatches& previous_supports() {
    if (supports_.empty()) supports_.emplace_back();
    if (support_slabs_ == 0) supports_[0].clear(), support_slabs_ = 1;
    return supports_[0];
  }
  // Pairs of bodies that were swept in the last find_contacts(); calls visit(a, b) for the member's share of
  // them. b may be static.
  bool any_swept() const { return swept_pairs_ > 0; }
  // True if a pair contact of the last find_contacts() is on a body other than a sphere.
  bool any_flat_pair() const { return any_flat_pair_; }
  template <class Visit>
  void for_each_swept_pair(const Member& member, Visit visit) const {
    IndexRange own = member.share(swept_pairs_);
    for (const SlabResults& results : slab_results_) {
      const int size = static_cast<int>(results.swept_pairs.size());
      for (int k = std::max(0, own.begin); k < std::min(size, own.end); ++k)
        visit(results.swept_pairs[k].first, results.swept_pairs[k].second);
      own.begin -= size, own.end -= size;
    }
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
  // Contacts up to this separation are always kept, so that resting contacts do not flicker, u.
  static constexpr float kMinSpeculativeMargin = 0.02F;
  // Each of equal spheres touches at most twelve others, and the smaller of two unequal ones has few larger
  // neighbours. That makes six pairs per body, and some more within the margin.
  static constexpr std::size_t kMaxPairsPerBody = 64;
  struct LargeNeighbour {
    std::int32_t body, large;
  };
  // A body that may move farther in this step than its bounding radius, and the bounds of its motion. The
  // grid stores its start only.
  struct FastBody {
    std::int32_t body;
    Vec3 low, high;
  };
  // A static body near a body, and its contacts in the slab's list.
  struct StaticNeighbour {
    std::int32_t body;
    bool is_swept = false;
    float impact_s = 0.0F;  // when a swept pair first touches; 0 if it does not
    std::size_t first = 0, end = 0;
  };
  // Contacts found in one slab.
  struct SlabResults {
    int member = 0;  // the member that collides the slab
    bool overloaded = false;
    bool has_flat_pair = false;    // a manifold on a body other than a sphere
    int expected_pair = 0;         // see PreviousContacts::find_pair
    std::size_t end_of_pairs = 0;  // the most that the list of pairs may hold
    SupportPatches* supports = nullptr;
    // With several members: own contacts before the merge, and where they begin in the lists of the step. A
    // single member writes into those lists.
    ContactList pair_contacts, static_contacts;
    std::int32_t first_pair_contact = 0, first_static_contact = 0;
    std::size_t pair_count = 0, static_count = 0, contact_count = 0;  // manifolds, and their contacts
    std::vector<std::pair<std::int32_t, std::int32_t>> swept_pairs;
    std::vector<std::int32_t> touched_sleepers;
    std::size_t tested_pairs = 0;
    PairManifoldCache::ChunkCache cached_pairs;
    FieldManifoldCache::ChunkCache cached_field;
  };
  void compute_large_radius(const BodyStore&);
  void measure_bodies(const BodyStore&);
  bool has_sleepers() const { return grid_bodies_.size() < body_indices_.size(); }
  std::span<const std::int32_t> own_bodies_in_grid(const Member&) const;
  float travel_of(const BodyStore&, std::size_t body) const;
  // Calls found(other) for the bodies of a grid's cells that a large body may touch in this step.
  template <class Found>
  void for_each_in_reach_of_large(const BodyStore&, const UniformGrid&, std::size_t large, Found found) const;
  void add_rows_of_sleepers(const BodyStore&);
  // Returns the greatest travel.
  float compute_query_radii(const BodyStore&, std::span<const std::int32_t> own);
  bool is_fast(std::size_t body) const { return speculative_margin_[body] > fast_margin_[body]; }
  FastBody fast_body(const BodyStore&, std::size_t body) const;
  void find_fast_bodies(const BodyStore&);
  template <class Found>
  void for_each_fast_in_box(const Vec3& low, const Vec3& high, std::size_t from, Found found) const;
  void find_fast_neighbours(const BodyStore&);
  void begin_detection(const BodyStore&, ContactList& pair_contacts, ContactList& static_contacts,
                       int member_count);
  void find_large_neighbours(const BodyStore&);
  void group_large_neighbours();
  void swap_supports(int bodies);
  void move_static_points(const BodyStore&, std::size_t body, std::span<Contact>) const;
  void find_support(const BodyStore&, std::size_t body, float margin, std::size_t field_contacts,
                    SlabResults& results) const;
  // The stiffness up to which the tops under a body act as springs, mass/s²; stiffer ones are rigid. `patch`:
  // index in `previous` of the body's patch of the last step.
  float greatest_elastic_stiffness(const BodyStore&, std::size_t body, const SupportPatches* previous,
                                   std::int32_t patch, std::span<const Contact>) const;
  void collide_slab(const BodyStore&, int slab, SlabResults& results);
  void collide_bodies_in_cells(const BodyStore&, IndexRange sorted, SlabResults& results) const;
  void collide_large_bodies(const BodyStore&, SlabResults& results) const;
  void collide_static(const BodyStore&, std::size_t body, SlabResults& results) const;
  void collide_static_bodies(const BodyStore&, std::size_t body, SlabResults& results) const;
  void collide_static_body(const BodyStore&, std::size_t body, StaticNeighbour&, SlabResults& results) const;
  void correct_internal_edges(const BodyStore&, std::size_t body, std::span<const StaticNeighbour>,
                              std::vector<Contact>&) const;
  // True if the bodies may close more than half of the thinner one's width in this step.
  bool may_pass(std::size_t a, std::size_t b) const {
    return travel_[a] + travel_[b] > 0.5F * std::min(thickness_[a], thickness_[b]);
  }
  void collide_pair(const BodyStore&, std::size_t i, std::size_t j, SlabResults& results) const;
  void collide_swept_pair(const BodyStore&, std::size_t a, std::size_t b, SlabResults& results) const;
  void find_slab_ranges();
  void make_room(ContactList& pair_contacts, ContactList& static_contacts);
  void update_slab_weights();
  static void merge(const ContactList& from, std::int32_t first_manifold, std::int32_t first_contact,
                    ContactList& to);

  const surface::Field& field_;
  float dt_s_, substep_s_;
  float mean_substep_start_s_;
  float ground_height_, gravity_;
  FieldCollider collider_;
  float large_radius_ = -1.0F;  // bodies with a larger query radius stay outside the grid's cells; < 0: stale
  UniformGrid* grid_ = nullptr;  // of the thread that steps, from update_broadphase() to the end of the step
  UniformGrid sleeper_grid_;
  Vec3 sleepers_low_{0, 0, 0}, sleepers_high_{0, 0, 0};  // bounds of the spheres in which they may be touched
  unsigned sleeper_version_ = 0;                         // see update_sleepers()
  std::vector<std::int32_t> grid_bodies_;                // in `grid_`, ascending: those that do not sleep
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
  std::vector<LargeNeighbour> large_neighbours_, found_large_neighbours_;
  std::vector<IndexRange> large_neighbours_of_;  // by body: range in large_neighbours_
  PreviousContacts previous_contacts_;
  SlabQueue slab_queue_;
  std::vector<SlabResults> slab_results_;                     // one per slab
  std::vector<SupportPatches> supports_, previous_supports_;  // one per slab
  std::size_t max_pairs_ = 0;                                 // in one slab, in this step
  int swept_pairs_ = 0;                                       // of all slabs
  bool overloaded_ = false, any_flat_pair_ = false;
  std::size_t support_slabs_ = 0;  // number of lists of this step in supports_
  struct SupportReference {
    std::int32_t slab, patch;  // slab < 0: none
  };
  BodyMap<SupportReference> previous_support_of_body_{{-1, -1}};
  SlabRanges pair_ranges_, static_ranges_;
  std::vector<std::size_t> contacts_per_slab_;  // in the last find_contacts()
  PairManifoldCache pair_cache_;
  FieldManifoldCache field_cache_;
};

template <class Found>
void CollisionPipeline::for_each_sleeper_in_reach(const BodyStore& bodies, std::size_t body,
                                                  Found found) const {
  const float travel = travel_of(bodies, body), margin = std::max(kMinSpeculativeMargin, travel);
  const float radius = bodies.bounding_radius[body];
  const Vec3& at = bodies.position[body];
  auto test = [&](std::int32_t sleeper) {
    const float radius_sum = radius + std::min(margin, radius) + query_radius_[sleeper];
    if ((at - bodies.position[sleeper]).squaredNorm() < radius_sum * radius_sum) found(sleeper);
  };
  const Vec3 half = Vec3::Constant(radius + std::min(margin, radius));
  sleeper_grid_.for_each_in_box(at - half, at + half, test);
  std::ranges::for_each(sleeper_grid_.large_bodies(), test);
  if (margin <= fast_margin_[body]) return;
  // Sleepers in the path of a body that flies farther than its own size.
  const Vec3 path = dt_s_ * bodies.velocity(body);
  const float length = std::max(path.squaredNorm(), 1e-20F);
  auto test_path = [&](std::int32_t sleeper) {
    const Vec3 offset = bodies.position[sleeper] - at;
    const float along = std::clamp(offset.dot(path) / length, 0.0F, 1.0F),
                reach = radius + query_radius_[sleeper];
    if ((offset - along * path).squaredNorm() < reach * reach) found(sleeper);
  };
  const FastBody fast = fast_body(bodies, body);
  sleeper_grid_.for_each_in_box(fast.low, fast.high, test_path);
  std::ranges::for_each(sleeper_grid_.large_bodies(), test_path);
}

template <class Found>
void CollisionPipeline::for_each_in_reach_of_large(const BodyStore& bodies, const UniformGrid& grid,
                                                   std::size_t large, Found found) const {
  const Vec3 half = turned_extents(bodies.axes[large], bodies.shape[large]->half_extents) +
                    Vec3::Constant(speculative_margin_[large]);
  const Vec3 centre = bodies.origin(large);
  grid.for_each_in_box(centre - half, centre + half, found);
}

template <class Found>
void CollisionPipeline::for_each_fast_in_box(const Vec3& low, const Vec3& high, std::size_t from,
                                             Found found) const {
  const auto begin = fast_bodies_.begin() + from;
  const auto first = std::ranges::lower_bound(begin, fast_bodies_.end(), low.x() - max_fast_length_, {},
                                              [](const FastBody& f) { return f.low.x(); });
  for (auto f = first; f != fast_bodies_.end() && f->low.x() <= high.x(); ++f)
    if ((f->low.array() <= high.array()).all() && (f->high.array() >= low.array()).all()) found(f->body);
}

}  // namespace smartsurf::world

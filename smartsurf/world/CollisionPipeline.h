// Finds all contacts of a step: bodies against the field, the ground, fixed bodies and each other.
#pragma once

#include <algorithm>
#include <memory>
#include <span>
#include <vector>

#include "smartsurf/surface/Field.h"
#include "smartsurf/world/BodyStore.h"
#include "smartsurf/world/Contact.h"
#include "smartsurf/world/PreviousContacts.h"
#include "smartsurf/world/broadphase/UniformGrid.h"
#include "smartsurf/world/field/FieldManifoldCache.h"
#include "smartsurf/world/field/FreeLayoutField.h"
#include "smartsurf/world/narrowphase/PairManifoldCache.h"
#include "smartsurf/world/parallel/SpatialPartition.h"
#include "smartsurf/world/parallel/Team.h"

namespace smartsurf::world {

class CollisionPipeline {
 public:
  // `ground`: the height of the endless floor, or −infinity.
  CollisionPipeline(const surface::Field& field, float dt_s, float ground)
      : field_(field), dt_s_(dt_s), ground_height_(ground), field_cache_(field) {
    if (!field.is_rectangular()) free_layout_field_ = std::make_unique<FreeLayoutField>(field);
  }

  // Sorts the bodies into the grid, as they are now. First in a step; all members of the team together.
  void update_broadphase(const BodyStore&, const Member&);
  // Calls found(other) for the bodies that one may be within reach of in this step; fixed ones left aside.
  template <class Found>
  void for_each_nearby(const BodyStore&, std::size_t body, Found found) const;

  // Those of a member's part of the table: where it found them in the last step, for most are there still.
  // Every body is one member's; before they are found first, by their indices.
  std::span<const std::int32_t> own_bodies(const Member&) const;

  // Contacts of what moves, in an order that depends on the bodies alone. On entry the lists hold the last
  // step's contacts, whose impulses are handed on to the new ones. All members of the team together.
  void find_contacts(const BodyStore&, ContactList& pair_contacts, ContactList& static_contacts,
                     const Member&);

  // How the bodies lie, since arrange(), and where in the lists each slab's manifolds are, since detect().
  const SpatialPartition& partition() const { return partition_; }
  const SlabRanges& pair_ranges() const { return pair_ranges_; }
  const SlabRanges& static_ranges() const { return static_ranges_; }

  // Appends the contacts of a shape with the field, the ground left aside.
  void collide_field(const Shape&, const Vec3& centre, const Mat3& axes, float margin,
                     std::vector<Contact>& out) const;
  // Whether any column under the box may reach up into it.
  bool field_may_overlap(const Vec3& low, const Vec3& high) const;
  float min_half_top() const { return std::min(field_.half_top_x, field_.half_top_y); }

  // A body was added or removed: the sizes must be looked at again, and contacts of the one removed
  // forgotten. One by one.
  void on_bodies_changed(int bodies) {
    large_radius_ = -1.0F;
    body_indices_.resize(static_cast<std::size_t>(bodies));
    if (bodies > 0) body_indices_.back() = bodies - 1;
    for (SlabResults& f : slab_results_) f.cached_pairs = {}, f.cached_field = {};
  }

 private:
  struct LargeNeighbour {
    std::int32_t body, large;
  };
  // In one slab.
  struct SlabResults {
    int member = 0;  // who looks
    ContactList pair_contacts, static_contacts;
    PairManifoldCache::ChunkCache cached_pairs;
    FieldManifoldCache::ChunkCache cached_field;
  };
  struct ContactCounts {
    std::size_t manifolds = 0, contacts = 0;
  };
  // Of a piece: where it begins in its slab's list and in the joined one, and how much there is.
  struct BodyRunOutput {
    ContactCounts from, to, count;
  };

  void compute_large_radius(const BodyStore&);
  void compute_query_radii(const BodyStore&, std::span<const std::int32_t> own);
  void begin_detection(ContactList& pair_contacts, ContactList& static_contacts, int member_count);
  void find_large_neighbours(const BodyStore&);
  void collide_slab(const BodyStore&, int slab, SlabResults& results);
  void collide_body_run(const BodyStore&, const SpatialPartition::BodyRun&, SlabResults& results) const;
  void collide_large_bodies(const BodyStore&, SlabResults& results) const;
  void collide_static(const BodyStore&, std::size_t body, SlabResults& results) const;
  void collide_static_body(const BodyStore&, std::size_t body, std::size_t static_body,
                           SlabResults& results) const;
  void collide_pair(const BodyStore&, std::size_t i, std::size_t j, SlabResults& results) const;
  void assign_output_offsets(std::vector<BodyRunOutput>&, ContactList&, SlabRanges&) const;
  void update_slab_weights();
  void merge_slab(int slab, const std::vector<BodyRunOutput>&, const ContactList& from, ContactList& to,
                  SlabRanges&) const;

  const surface::Field& field_;
  std::unique_ptr<FreeLayoutField> free_layout_field_;  // for a layout that is not rectangular
  float dt_s_, ground_height_;
  float large_radius_ = -1.0F;  // bodies with more reach are few and large; < 0: not known
  UniformGrid grid_;
  SpatialPartition partition_;
  std::vector<float> query_radius_, speculative_margin_;
  std::vector<std::int32_t> body_indices_;  // bodies, by index
  std::vector<LargeNeighbour> large_neighbours_;
  std::vector<std::int32_t> first_large_neighbour_;  // of each body, in near_
  PreviousContacts previous_contacts_;
  std::vector<SlabResults> slab_results_;                   // one a slab
  std::vector<BodyRunOutput> pair_output_, static_output_;  // one a piece
  SlabRanges pair_ranges_, static_ranges_;
  std::vector<std::size_t> contacts_per_slab_;  // each slab
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
  grid_.for_each_in_box(bodies.position[body] - half, bodies.position[body] + half, test);
  for (const std::int32_t large : grid_.large_bodies()) test(large);
}

}  // namespace smartsurf::world

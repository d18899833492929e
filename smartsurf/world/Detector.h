// Finds all contacts of a step: bodies against the field, the ground, fixed bodies and each other.
#pragma once

#include <algorithm>
#include <memory>
#include <span>
#include <vector>

#include "smartsurf/surface/Field.h"
#include "smartsurf/world/Bodies.h"
#include "smartsurf/world/Contact.h"
#include "smartsurf/world/FieldMemory.h"
#include "smartsurf/world/Grid.h"
#include "smartsurf/world/LooseField.h"
#include "smartsurf/world/OldContacts.h"
#include "smartsurf/world/PairMemory.h"
#include "smartsurf/world/Slabs.h"
#include "smartsurf/world/Team.h"

namespace smartsurf::world {

class Detector {
 public:
  // `ground`: the height of the endless floor, or −infinity.
  Detector(const surface::Field& field, float dt_s, float ground)
      : field_(field), dt_s_(dt_s), ground_(ground), field_memory_(field) {
    if (!field.rectangular()) loose_ = std::make_unique<LooseField>(field);
  }

  // Sorts the bodies into the grid, as they are now. First in a step; all members of the team together.
  void arrange(const BodyStore&, const Member&);
  // Calls found(other) for the bodies that one may be within reach of in this step; fixed ones left aside.
  template <class Found>
  void for_near(const BodyStore&, std::size_t body, Found found) const;

  // Those of a member's part of the table: where it found them in the last step, for most are there still.
  // Every body is one member's; before they are found first, by their indices.
  std::span<const std::int32_t> own_bodies(const Member&) const;

  // Contacts of what moves, in an order that depends on the bodies alone. On entry the lists hold the last
  // step's contacts, whose impulses are handed on to the new ones. All members of the team together.
  void detect(const BodyStore&, ContactList& pairs, ContactList& world, const Member&);

  // How the bodies lie, since arrange(), and where in the lists each slab's manifolds are, since detect().
  const Slabs& slabs() const { return slabs_; }
  const SlabRuns& pair_runs() const { return pair_runs_; }
  const SlabRuns& world_runs() const { return world_runs_; }

  // Appends the contacts of a shape with the field, the ground left aside.
  void touch_field(const Shape&, const Vec3& centre, const Mat3& axes, float margin,
                   std::vector<Contact>& out) const;
  // Whether any column under the box may reach up into it.
  bool field_reaches(const Vec3& low, const Vec3& high) const;
  float narrowest_half_top() const { return std::min(field_.half_top_x, field_.half_top_y); }

  // A body was added or removed: the sizes must be looked at again, and contacts of the one removed
  // forgotten. One by one.
  void bodies_changed(int bodies) {
    large_ = -1.0F;
    all_.resize(static_cast<std::size_t>(bodies));
    if (bodies > 0) all_.back() = bodies - 1;
    for (Findings& f : found_) f.known_pairs = {}, f.known_field = {};
  }

 private:
  struct NearLarge {
    std::int32_t body, large;
  };
  // In one slab.
  struct Findings {
    int member = 0;  // who looks
    ContactList pairs, world;
    PairMemory::List known_pairs;
    FieldMemory::List known_field;
  };
  struct Extent {
    std::size_t manifolds = 0, contacts = 0;
  };
  // Of a piece: where it begins in its slab's list and in the joined one, and how much there is.
  struct Part {
    Extent from, to, count;
  };

  void find_large_size(const BodyStore&);
  void reach_out(const BodyStore&, std::span<const std::int32_t> own);
  void begin(ContactList& pairs, ContactList& world, int members);
  void look_around_large(const BodyStore&);
  void detect_slab(const BodyStore&, int slab, Findings& out);
  void detect_piece(const BodyStore&, const Slabs::Piece&, Findings& out) const;
  void detect_large(const BodyStore&, Findings& out) const;
  void touch_world(const BodyStore&, std::size_t body, Findings& out) const;
  void touch_fixed(const BodyStore&, std::size_t body, std::size_t fixed, Findings& out) const;
  void touch_pair(const BodyStore&, std::size_t i, std::size_t j, Findings& out) const;
  void place_parts(std::vector<Part>&, ContactList&, SlabRuns&) const;
  void weigh_slabs();
  void copy_slab(int slab, const std::vector<Part>&, const ContactList& from, ContactList& to,
                 SlabRuns&) const;

  const surface::Field& field_;
  std::unique_ptr<LooseField> loose_;  // for a layout that is not rectangular
  float dt_s_, ground_;
  float large_ = -1.0F;  // bodies with more reach are few and large; < 0: not known
  Grid grid_;
  Slabs slabs_;
  std::vector<float> reach_, margin_;
  std::vector<std::int32_t> all_;  // bodies, by index
  std::vector<NearLarge> near_;
  std::vector<std::int32_t> first_near_;  // of each body, in near_
  OldContacts old_;
  std::vector<Findings> found_;               // one a slab
  std::vector<Part> pair_part_, world_part_;  // one a piece
  SlabRuns pair_runs_, world_runs_;
  std::vector<std::size_t> contacts_in_;  // each slab
  PairMemory pair_memory_;
  FieldMemory field_memory_;
};

template <class Found>
void Detector::for_near(const BodyStore& bodies, std::size_t body, Found found) const {
  auto consider = [&](std::int32_t other) {
    const auto j = static_cast<std::size_t>(other);
    if (j == body || bodies.fixed(j)) return;
    const float reach = reach_[body] + reach_[j];
    if ((bodies.position[body] - bodies.position[j]).squaredNorm() < reach * reach) found(j);
  };
  const Vec3 half = Vec3::Constant(reach_[body]);
  grid_.for_box(bodies.position[body] - half, bodies.position[body] + half, consider);
  for (const std::int32_t large : grid_.large()) consider(large);
}

}  // namespace smartsurf::world

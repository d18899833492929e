// Contact points and manifolds: written by the narrow phase, solved and updated by the solver.
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "common/state/StateArchive.h"
#include "smartsurf/world/Vec.h"

namespace smartsurf::world {

// Values of Contact::other and Manifold::b that name no body. kRemovedBody replaces the index of a static body
// that was removed after the contact was found. kSupportedField is a contact with the field whose load and friction a
// support patch distributes (field/SupportPatch.h); kYieldingTip one with a tip that yields (solver/TipSolver.h);
// kSkin one with a taut sheet over the cells (field/SkinContacts.h), kElasticSkin one with an elastic sheet.
inline constexpr std::int32_t kField = -1, kGround = -2, kRemovedBody = -3, kSupportedField = -4,
                              kYieldingTip = -5, kSkin = -6, kElasticSkin = -7;

// Whether what a contact touches moves under the load, by Contact::other.
inline bool gives_way(std::int32_t other) { return other == kYieldingTip || other == kElasticSkin; }

// One contact point.
struct Contact {
  Vec3 normal;                     // unit, towards body a
  Vec3 anchor;                     // from a's centre of mass to the point, world axes, u
  float separation = 0.0F;         // along the normal, u; negative when penetrating
  std::int32_t other = 0;          // static contacts: see above, or the index of a static body; pairs: unused
  std::int32_t feature_id = 0;     // field contacts: index of the cell, row-major
  Vec3 surface_velocity{0, 0, 0};  // of the static surface at the point, u/s
  float surface_spin = 0;          // of the static surface about the vertical, rad/s
  // The body's share of the cell's force limit, mass·u/s in a step: bounds the sum over its contacts on the cell.
  float max_cell_impulse = std::numeric_limits<float>::infinity();
  // Impulses of the last substep, mass·u/s (rolling: mass·u²/s), which warm-start the next step, and the sum of
  // the normal impulses over the step, restitution included.
  float normal_impulse = 0.0F;
  Vec3 friction_impulse{0, 0, 0};
  Vec3 rolling_impulse{0, 0, 0};
  float total_normal_impulse = 0.0F;
};

// The contacts of one pair of bodies (a < b), or all static contacts of body a (b = kField).
struct Manifold {
  std::int32_t a, b;
  std::int32_t first, count;  // range in ContactList::contacts
};

struct ContactList {
  std::vector<Manifold> manifolds;
  std::vector<Contact> contacts;
  void clear() {
    manifolds.clear();
    contacts.clear();
  }
  void archive(common::StateArchive& a) { a(manifolds, contacts); }
};

// Prepares the list for the removal of `body`: erases its manifolds and decrements all body indices above it.
// Contacts of erased manifolds stay in `contacts`, unreferenced.
void remove_body(ContactList&, std::int32_t body);

}  // namespace smartsurf::world

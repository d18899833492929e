// Contact points and manifolds: written by the narrow phase, solved and updated by the solver.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "common/state/StateArchive.h"
#include "smartsurf/world/body/Vec.h"

namespace smartsurf::world {

// Contacts up to this separation count as touching where loads or blows are passed on, u.
inline constexpr float kTouchingSeparation = 1e-3F;

// The partner of a body in a static contact. Values from 0 up are indices of static bodies.
enum class Partner : std::int32_t {
  kCell = -1,           // a column or a rigid tip
  kGround = -2,         // the plane under the field
  kRemovedBody = -3,    // a static body that was removed after the contact was found
  kSupportedCell = -4,  // a cell whose load and friction a support patch distributes (field/SupportPatch.h)
  kYieldingTip = -5,    // a tip on springs (solver/TipSolver.h)
  kSkin = -6,           // a kinematic skin over the cells (field/SkinContacts.h)
  kElasticSkin = -7,    // an elastic one (solver/SkinSolver.h)
  kElasticTop = -8,  // a cell with an elastic top, whose load a support patch finds (solver/SupportSprings.h)
};

// One contact point.
struct Contact {
  Contact() {}  // leaves the normal and the anchor as they are, where emplace_back() would clear all first

  Vec3 normal;                     // unit, towards body a
  Vec3 anchor;                     // from a's centre of mass to the point, world axes, u
  float separation = 0.0F;         // along the normal, u; negative when penetrating
  Partner partner{};               // unused in pairs of bodies
  std::int32_t feature_id = 0;     // field contacts: index of the cell, row-major
  Vec3 surface_velocity{0, 0, 0};  // of the static surface at the point, u/s
  float surface_spin = 0;          // of the static surface about the vertical, rad/s
  // The body's share of the cell's force limit, mass·u/s in a step: bounds the sum over its contacts on the
  // cell.
  float max_cell_impulse = std::numeric_limits<float>::infinity();
  // Impulses of the last substep, mass·u/s (rolling: mass·u²/s), which warm-start the next step, and the sum
  // of the normal impulses over the step, restitution included.
  float normal_impulse = 0.0F;
  Vec3 friction_impulse{0, 0, 0};
  Vec3 rolling_impulse{0, 0, 0};
  float total_normal_impulse = 0.0F;
  // The fraction of the friction that a corner of a face patch loses under a pure twist about the centre of
  // the patch's load: the corners would bear a twist as a ring does, not as a face. Equal in all contacts of
  // a patch, of which a manifold has one at most; 0 elsewhere.
  float twist_friction_loss = 0.0F;
  // When the point is at the anchor, from the start of the step (narrowphase/RollingPoints.h); negative while
  // it is to be moved there (narrowphase/PairContacts.h).
  float anchor_time_s = 0.0F;
  // Acceleration of the partner's surface relative to a's at a rolling point (narrowphase/RollingPoints.h),
  // u/s². `surface_velocity` is then that at the start of the step, on which the surfaces pass each other.
  Vec3 surface_acceleration{0, 0, 0};

  bool touches_cell() const { return partner == Partner::kCell || partner == Partner::kSupportedCell; }
  bool touches_body() const { return static_cast<std::int32_t>(partner) >= 0; }  // a static one
  bool touches_skin() const { return partner == Partner::kSkin || partner == Partner::kElasticSkin; }
  // True if the partner moves under the load.
  bool gives_way() const {
    return partner == Partner::kYieldingTip || partner == Partner::kElasticSkin ||
           partner == Partner::kElasticTop;
  }
  // True if the surface moves exactly as the cell `feature_id` does.
  bool moves_with_cell() const { return touches_cell() || partner == Partner::kSkin; }
  // True if a support patch has the load of the cell, and the friction.
  bool is_in_patch() const { return partner == Partner::kSupportedCell || partner == Partner::kElasticTop; }
  // True if the impulse is a load of the cell `feature_id`.
  bool loads_cell() const {
    return partner == Partner::kCell || partner == Partner::kYieldingTip || touches_skin();
  }
};

// For contacts of several patches.
inline void keep_friction_of_twist(std::span<Contact> contacts) {
  for (Contact& c : contacts) c.twist_friction_loss = 0.0F;
}

// The contacts of one pair of bodies (a < b), or all static contacts of body a (b = kStatic).
struct Manifold {
  static constexpr std::int32_t kStatic = -1;
  std::int32_t a, b;
  std::int32_t first, count;  // range in ContactList::contacts
};

// Index of the body that the contact's body a touches; negative if it touches none.
inline std::int32_t other_body(const Manifold& m, const Contact& c) {
  return m.b >= 0 ? m.b : static_cast<std::int32_t>(c.partner);
}

struct ContactList {
  std::vector<Manifold> manifolds;
  std::vector<Contact> contacts;
  std::span<const Contact> contacts_of(const Manifold& m) const {
    return std::span(contacts).subspan(m.first, m.count);
  }
  std::span<Contact> contacts_of(const Manifold& m) { return std::span(contacts).subspan(m.first, m.count); }
  // Appends a copy of another list's manifold with its contacts.
  void append(const ContactList& from, const Manifold& m) {
    manifolds.push_back({m.a, m.b, static_cast<std::int32_t>(contacts.size()), m.count});
    const auto added = from.contacts_of(m);
    contacts.insert(contacts.end(), added.begin(), added.end());
  }
  void clear() {
    manifolds.clear();
    contacts.clear();
  }
  void archive(common::StateArchive& a) { a(manifolds, contacts); }
};

// Where the contacts of a body load it, from its centre of mass: the mean of their anchors by the normal
// impulses of the step. 0 if they bear nothing.
Vec3 centre_of_load(std::span<const Contact>);

// Prepares the list for the removal of `body`: erases its manifolds and decrements all body indices above it.
// Contacts of erased manifolds stay in `contacts`, unreferenced.
void remove_body(ContactList&, std::int32_t body);

}  // namespace smartsurf::world

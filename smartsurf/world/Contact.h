// Where bodies touch: what the narrow phase finds and the solver works on.
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "smartsurf/world/Vec.h"

namespace smartsurf::world {

// What a body touches, where that is no moving body.
inline constexpr std::int32_t kField = -1, kGround = -2, kRemovedBody = -3;

// One point of contact. A gap below 0 is a depth of penetration.
struct Contact {
  Vec3 normal;              // unit, from the other side towards a
  Vec3 anchor;              // from a's centre of mass to the point, world axes
  float separation = 0.0F;  // along the normal, u
  std::int32_t other = 0;   // against the world: kField, kGround, or the index of a fixed body
  std::int32_t feature_id =
      0;  // tells the points of one manifold apart from step to step: the cell, where it is the field
  Vec3 surface_velocity{0, 0, 0};  // velocity of the world's surface there, u/s
  float surface_spin = 0;          // its turning about the vertical, rad/s
  // The greatest push of a step that the cell can give here, mass·u/s.
  float max_normal_impulse = std::numeric_limits<float>::infinity();
  // Impulses of the last substep, which start the next one, and the sum of `push` over the step (mass·u/s).
  float normal_impulse = 0.0F;
  Vec3 friction_impulse{0, 0, 0};
  Vec3 rolling_impulse{0, 0, 0};
  float total_normal_impulse = 0.0F;
};

// The contacts of one pair of bodies, or all those of one body with the world (b < 0).
struct Manifold {
  std::int32_t a, b;
  std::int32_t first, count;
};

struct ContactList {
  std::vector<Manifold> manifolds;
  std::vector<Contact> contacts;
  void clear() {
    manifolds.clear();
    contacts.clear();
  }
};

// Takes out the manifolds of a body that is about to go, and closes the gap that it leaves among the indices.
void remove_body(ContactList&, std::int32_t body);

}  // namespace smartsurf::world

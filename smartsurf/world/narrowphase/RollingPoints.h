// Where the contact points of round sides are when impulses act, by the kinematics of contact (Montana, "The
// kinematics of contact and grasp", 1988).
//
// Contacts are found at the start of a step. What rolls moves its contact points over both bodies meanwhile:
// impulses with the levers of the start lag behind, and drive what rocks. As a point moves, the surfaces pass
// it at another velocity, w × u for a body that turns at w while the point leaves its centre of mass at u,
// and a body that is no ball turns differently by its gyroscopic torque: with the velocities of one instant
// for the whole step, each step would begin with a false approach, and lose or gain the energy of it.
#pragma once

#include <cstddef>
#include <optional>
#include <span>

#include "smartsurf/world/body/BodyStore.h"
#include "smartsurf/world/contact/Contact.h"

namespace smartsurf::world {

// True if the body has a round side and may roll on it.
inline bool may_roll(const BodyStore& bodies, std::size_t body) {
  return bodies.is_sphere[body] || bodies.shape[body]->is_axisymmetric();
}

// Moves the points of contacts of bodies a and b, one of which may_roll(), to where they are `time_s` after
// the start of the step, or earlier if they roll far by then, and sets how their surfaces' velocity changes.
// Anchors are from a's origin. b may be static, or nothing for flat ground at rest.
void move_rolling_points(const BodyStore&, std::size_t a, std::optional<std::size_t> b, float time_s,
                         std::span<Contact>);

}  // namespace smartsurf::world

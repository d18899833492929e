// Lets the cells under a jammed body stall: a body that is pressed deep into cells or other bodies has no way out, and
// cells that go on rising would enter it.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "smartsurf/surface/Field.h"
#include "smartsurf/world/BodyStore.h"
#include "smartsurf/world/Contact.h"

namespace smartsurf::world {

// A body with a deep contact in this step.
struct DeepContact {
  std::int32_t body;
  float depth;  // u
};

class JamRelief {
 public:
  explicit JamRelief(float dt_s);

  // Contacts from this depth on count as deep, u.
  float min_depth() const { return min_depth_; }

  // Before the contacts are found: the cells that stalled in the last step under a non-sphere do not rise faster in this one, or their contacts
  // would go on pushing. Returns whether it lowered any speed.
  bool hold_cells(surface::Field&);
  // After the solver: lowers the upward Field::speed of the cells that push the bodies, the more the deeper they are, to
  // 0 at a depth of twice min_depth(); cells that descend likewise where a body is wedged against their sides. A rising cell that is itself deeper in a body retreats. Returns whether it lowered
  // any speed.
  bool stall_cells(std::span<const DeepContact>, const ContactList& static_contacts, const BodyStore&,
                   surface::Field&);

 private:
  struct StalledCell {
    std::int32_t cell;
    float speed;  // upper bound, lower bound if it descends, u/s
    bool descends;
  };
  float min_depth_;
  std::vector<StalledCell> stalled_, held_;  // in this step, and in the last one
  std::vector<float> planned_speed_;         // by cell, of held cells; otherwise 0, u/s
  std::vector<float> depth_;                 // by body; zero between calls
};

}  // namespace smartsurf::world

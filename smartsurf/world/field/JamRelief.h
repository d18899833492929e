// Lets the cells under a jammed body stall: a body that is pressed deep into cells or other bodies has no way out, and
// cells that go on rising would enter it.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "smartsurf/surface/Field.h"
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

  // After the solver: lowers the upward Field::speed of the cells that push the bodies, the more the deeper they are, to
  // 0 at a depth of twice min_depth(). A rising cell that is itself deeper in a body retreats. Returns whether it lowered
  // any speed.
  bool stall_cells(std::span<const DeepContact>, const ContactList& static_contacts, std::size_t bodies,
                   surface::Field&);

 private:
  float min_depth_;
  std::vector<float> depth_;  // by body; zero between calls
};

}  // namespace smartsurf::world

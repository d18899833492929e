// Jam relief: cells stall under a jammed body, one that is pressed deep into cells or other bodies or off its
// joints. It has no way out, and cells that go on rising would enter it.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "smartsurf/surface/Field.h"
#include "smartsurf/world/body/BodyStore.h"
#include "smartsurf/world/contact/Contact.h"
#include "smartsurf/world/field/SupportPatch.h"

namespace smartsurf::world {

// A body that is deep in a cell or in another one, of which the upper one does not give way, or off its
// joints, in this step.
struct JammedBody {
  std::int32_t body;
  float depth;      // u
  bool from_above;  // the contact presses the body down
};

class JamRelief {
 public:
  explicit JamRelief(float dt_s);

  // Bodies in contacts from this depth on count as jammed, u.
  float min_depth() const { return min_depth_; }

  // Before the contacts are found: cells that stalled lately do not rise faster than then, or they would go
  // on pushing whenever the body leaves them for a step. Returns whether it lowered any speed.
  bool hold_cells(surface::Field&);
  // After the solver: appends the bodies that jammed ones press on. Bodies that are off their joints need it:
  // their contacts hold at the joints' expense, so no other body between them and the cells is in a deep
  // contact.
  void spread(std::vector<JammedBody>&, const ContactList& pair_contacts, const BodyStore&);
  // After the solver: lowers the upward Field::speed of the cells that push the bodies, the more the deeper
  // they are, to 0 at a depth of twice min_depth(); cells that descend likewise where a body is wedged
  // against their sides. A rising cell that is itself deeper in a body retreats, and one that does not touch
  // it yet comes no nearer than that. Returns whether it lowered any speed.
  bool stall_cells(std::span<const JammedBody>, const ContactList& static_contacts,
                   std::span<const SupportPatches>, const BodyStore&, surface::Field&);
  void archive(common::StateArchive&);

 private:
  struct StalledCell {
    std::int32_t cell;
    float speed;  // upper bound, lower bound if it descends, u/s
    bool descends;
    std::int32_t steps_left;
  };
  struct Jam {
    float depth = 0.0F;
    bool from_above = false;
  };
  bool slow_down(std::int32_t cell, float bound, bool holds, surface::Field&);
  void hold(const StalledCell&);

  float dt_s_, min_depth_;
  std::int32_t hold_steps_;
  std::vector<StalledCell> held_;
  std::vector<std::int32_t> held_of_cell_;  // index in held_, or −1
  std::vector<float> planned_speed_;        // by cell, of held cells; otherwise 0, u/s
  std::vector<Jam> jam_;                    // by body; zero between calls
};

}  // namespace smartsurf::world

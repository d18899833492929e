// Cells of limited force: how much of it each body may take in a step, and how far a cell gives way that has
// to bear more.
#pragma once

#include <vector>

#include "smartsurf/surface/Field.h"
#include "smartsurf/world/Bodies.h"
#include "smartsurf/world/Contact.h"

namespace smartsurf::world {

class CellLimits {
 public:
  // Before the impulses: sets Contact::limit, of contacts that carry the impulses of the last step. Those
  // with one cell share its force.
  void share_out(const surface::Field&, float dt_s, ContactList& world);

  // After the impulses, with the shifts of the bodies: a cell that gave all its force moves no faster upward
  // than what lies on it, or as much faster downward.
  void give_way(const BodyStore&, const ContactList& world, float dt_s, surface::Field&);

 private:
  // Calls each(contact, manifold, cell) for the contacts with cells of limited force.
  template <class List, class Each>
  void for_limited(const surface::Field&, List& world, Each each) const;

  std::vector<float> load_;            // of each cell; 0 between the calls
  std::vector<std::int32_t> sharers_;  // the same
};

}  // namespace smartsurf::world

// Cells of limited force: how much of it each body may take in a step, and how far a cell gives way that has
// to bear more.
#pragma once

#include <vector>

#include "smartsurf/surface/Field.h"
#include "smartsurf/world/BodyStore.h"
#include "smartsurf/world/Contact.h"

namespace smartsurf::world {

class CellForceLimits {
 public:
  // Before the impulses: sets Contact::limit, of contacts that carry the impulses of the last step. Those
  // with one cell share its force.
  void distribute_limits(const surface::Field&, float dt_s, ContactList& static_contacts);

  // After the impulses, with the shifts of the bodies: a cell that gave all its force moves no faster upward
  // than what lies on it, or as much faster downward.
  void yield_overloaded_cells(const BodyStore&, const ContactList& static_contacts, float dt_s,
                              surface::Field&);

 private:
  // Calls each(contact, manifold, cell) for the contacts with cells of limited force.
  template <class List, class Each>
  void for_each_limited(const surface::Field&, List& static_contacts, Each each) const;

  std::vector<float> load_;                  // of each cell; 0 between the calls
  std::vector<std::int32_t> contact_count_;  // the same
};

}  // namespace smartsurf::world

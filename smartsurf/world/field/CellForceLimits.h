// Enforces the force limits of cells: bounds the contact impulses on a limited cell and lets an overloaded
// cell yield.
#pragma once

#include <vector>

#include "smartsurf/surface/Field.h"
#include "smartsurf/world/BodyStore.h"
#include "smartsurf/world/Contact.h"

namespace smartsurf::world {

class CellForceLimits {
 public:
  // Before the solver: sets Contact::max_normal_impulse. Contacts on one cell share its force limit, mostly
  // in proportion to their warm-starting impulses.
  void distribute_limits(const surface::Field&, float dt_s, ContactList& static_contacts);

  // After the solver, with BodyStore::delta_pose of the step: lowers Field::speed of each saturated cell to
  // the velocity of the bodies on it.
  void yield_overloaded_cells(const BodyStore&, const ContactList& static_contacts, float dt_s,
                              surface::Field&);

 private:
  // Calls each(contact, manifold, cell) for the contacts with the tops of cells that have a force limit.
  template <class List, class Each>
  void for_each_limited(const surface::Field&, List& static_contacts, Each each) const;

  // Indexed by cell; zero between calls.
  std::vector<float> load_;  // vertical impulse, mass·u/s
  std::vector<std::int32_t> contact_count_;
};

}  // namespace smartsurf::world

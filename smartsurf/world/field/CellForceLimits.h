// Enforces the force limits of cells: shares them among the bodies on a cell and lets an overloaded cell
// yield.
//
// A body may put its share of the cell's force on it with all its contacts together; the solver bounds their
// sum and lowers the cell's speed by the motor's characteristic.
#pragma once

#include <span>
#include <vector>

#include "smartsurf/surface/Field.h"
#include "smartsurf/world/body/BodyStore.h"
#include "smartsurf/world/contact/Contact.h"

namespace smartsurf::world {

// The greatest speed at which a cell gives way to a contact, u/s.
inline constexpr float kMaxRetreatSpeed = 1.0F;

// A cell yields to a load of this fraction of its capacity.
inline constexpr float kYieldingLoad = 0.95F;

// The cell under a static contact, for the solver.
struct CellImpulseLimit {
  float no_load_speed = 0.0F, planned_speed = 0.0F;  // of the cell, u/s
  // Distance to the first contact of its body on the cell, in contacts; kNoLimit: no limit applies.
  std::int32_t to_first = kNoLimit;
  // For the first contact of a body on a cell: the number of such contacts, and the impulse that the cell
  // could give them in the step, set by the solver, mass·u/s.
  std::int32_t point_count = 0;
  float capacity = 0.0F;

  static constexpr std::int32_t kNoLimit = 1;
  bool is_limited() const { return to_first != kNoLimit; }
};

class CellForceLimits {
 public:
  // Before the solver: sets Contact::max_cell_impulse and limits(). The bodies on a cell share its force by
  // their demand: their warm-starting impulse, doubled if it used up their last share.
  void distribute_limits(const surface::Field&, float dt_s, int substeps, ContactList& static_contacts);

  // One per static contact; empty if no cell has a force limit.
  std::span<CellImpulseLimit> limits() { return limits_; }

  // After the solver, with BodyStore::delta_pose of the step: lowers Field::speed of each saturated cell to
  // the velocity of the bodies on it, and caps that of other cells so that they do not rise into those
  // bodies.
  void yield_overloaded_cells(const BodyStore&, const ContactList& static_contacts, float dt_s,
                              surface::Field&);

 private:
  // The contacts of one body on one cell.
  struct BodyOnCell {
    std::size_t cell;
    std::int32_t first_contact, contact_count = 0;
    float demand = 0.0F;      // vertical impulse, mass·u/s
    float last_share = 0.0F;  // mass·u/s in a step
  };

  // Calls each(contact, index) for the manifold's contacts with the tops of cells that have a force limit.
  template <class List, class Each>
  void for_each_limited(const surface::Field&, List& static_contacts, const Manifold&, Each each) const;
  void collect_bodies_on_cells(const surface::Field&, int substeps, const ContactList& static_contacts);

  std::vector<CellImpulseLimit> limits_;
  std::vector<BodyOnCell> bodies_on_cells_;    // in the order of the manifolds
  std::vector<std::int32_t> body_of_contact_;  // index in bodies_on_cells_
  // Indexed by cell; zero between calls, first_contact_ −1.
  std::vector<float> load_, body_load_,
      capacity_;  // vertical impulse, of all bodies, of one, and its bound, mass·u/s
  std::vector<std::int32_t> body_count_, first_contact_;
};

}  // namespace smartsurf::world

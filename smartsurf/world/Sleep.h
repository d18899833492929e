// Which bodies rest, and what wakes them.
//
// A body falls asleep when it and all that it touches have hardly moved for a while, on cells that do not
// move. Asleep it has no mass to the solver, so that nothing moves it, and costs nothing; its contacts are
// kept, with their impulses. It wakes when a cell under or beside it moves, when a force is put on it, when a
// neighbour moves, goes or is about to hit it; a hit wakes all that is connected with it.
#pragma once

#include <vector>

#include "smartsurf/surface/Field.h"
#include "smartsurf/world/Bodies.h"
#include "smartsurf/world/Contact.h"
#include "smartsurf/world/Team.h"

namespace smartsurf::world {

class Sleep {
 public:
  Sleep(const surface::Field& field, float dt_s, const Vec3& gravity)
      : field_(field), dt_s_(dt_s), gravity_(gravity) {}

  bool any() const { return sleepers_ > 0; }
  int sleepers() const { return sleepers_; }
  // Contacts between sleepers and of sleepers with the world, as they fell asleep.
  const ContactList& pairs() const { return pairs_; }
  const ContactList& world() const { return world_; }
  // Counts the changes of who is asleep.
  unsigned changes() const { return changes_; }

  // ---- before a step; `pairs` and `world` are the last step's contacts, to which those of the woken return
  void wake(BodyStore&, std::size_t body);
  // Also all that is connected with it by touching.
  void wake_connected(BodyStore&, std::size_t body);
  // Also its neighbours: for what is about to be moved by hand, or taken away.
  void disturb(BodyStore&, std::size_t body, const ContactList& pairs, const ContactList& world);
  void wake_what_is_pushed(BodyStore&);
  void wake_on_moving_cells(BodyStore&);
  void return_contacts(const BodyStore&, ContactList& pairs, ContactList& world);

  // ---- after a step: of each body that moves, then of all manifolds with the world, then of all
  void time_rest(BodyStore&, std::size_t body) const;
  // Those on moving cells do not rest. `manifolds`: of that list.
  void unsettle(BodyStore&, const ContactList& world, Range manifolds) const;
  void update(BodyStore&, const std::vector<std::int32_t>& moving, const ContactList& pairs,
              const ContactList& world);
  void forget_body(std::int32_t body);

  // Whether it moves so fast that what it hits must move with it.
  static bool fast(const BodyStore&, std::size_t body);

 private:
  struct Cells {
    std::int32_t row_begin = 0, row_end = 0, column_begin = 0, column_end = 0;
  };
  bool stands_on_moving_cells(const Contact&) const;
  void lay_down(BodyStore&, std::size_t body);
  Cells cells_around(const BodyStore&, std::size_t body) const;
  bool cells_move(const Cells&) const;

  const surface::Field& field_;
  float dt_s_;
  Vec3 gravity_;
  int sleepers_ = 0;
  unsigned changes_ = 0;
  bool woken_ = false;  // since the contacts were last sorted
  ContactList pairs_, world_;
  std::vector<char> restless_;  // has a neighbour that moves
  std::vector<char> held_;      // touches something, or nothing pulls it
  std::vector<Cells> cells_;    // under and beside each sleeper
  std::vector<std::uint8_t> row_moves_;
};

}  // namespace smartsurf::world

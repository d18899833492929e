// Which bodies rest, and what wakes them.
//
// A body falls asleep when it and all that it touches have hardly moved for a while, on cells that do not
// move. Asleep it has no mass to the solver, so that nothing moves it, and costs nothing; its contacts are
// kept, with their impulses. It wakes when a cell under or beside it moves, when a force is put on it, when a
// neighbour moves, goes or is about to hit it; a hit wakes all that is connected with it.
#pragma once

#include <vector>

#include "smartsurf/surface/Field.h"
#include "smartsurf/world/BodyStore.h"
#include "smartsurf/world/Contact.h"
#include "smartsurf/world/parallel/Team.h"

namespace smartsurf::world {

class Sleep {
 public:
  Sleep(const surface::Field& field, float dt_s, const Vec3& gravity)
      : field_(field), dt_s_(dt_s), gravity_(gravity) {}

  bool any_asleep() const { return sleeping_count_ > 0; }
  int sleeping_count() const { return sleeping_count_; }
  // Contacts between sleepers and of sleepers with the world, as they fell asleep.
  const ContactList& pair_contacts() const { return pair_contacts_; }
  const ContactList& static_contacts() const { return static_contacts_; }
  // Counts the changes of who is asleep.
  unsigned change_count() const { return change_count_; }

  // ---- before a step; `pairs` and `world` are the last step's contacts, to which those of the woken return
  void wake(BodyStore&, std::size_t body);
  // Also all that is connected with it by touching.
  void wake_island(BodyStore&, std::size_t body);
  // Also its neighbours: for what is about to be moved by hand, or taken away.
  void wake_with_neighbours(BodyStore&, std::size_t body, const ContactList& pair_contacts,
                            const ContactList& static_contacts);
  void wake_forced(BodyStore&);
  void wake_on_moving_cells(BodyStore&);
  void restore_contacts(const BodyStore&, ContactList& pair_contacts, ContactList& static_contacts);

  // ---- after a step: of each body that moves, then of all manifolds with the world, then of all
  void update_sleep_timer(BodyStore&, std::size_t body) const;
  // Those on moving cells do not rest. `manifolds`: of that list.
  void reset_timers_on_moving_cells(BodyStore&, const ContactList& static_contacts,
                                    IndexRange manifolds) const;
  void update_sleeping_set(BodyStore&, const std::vector<std::int32_t>& active_bodies,
                           const ContactList& pair_contacts, const ContactList& static_contacts);
  void on_body_removed(std::int32_t body);

  // Whether it moves so fast that what it hits must move with it.
  static bool is_fast(const BodyStore&, std::size_t body);

 private:
  struct CellRect {
    std::int32_t row_begin = 0, row_end = 0, column_begin = 0, column_end = 0;
  };
  bool touches_moving_cell(const Contact&) const;
  void put_to_sleep(BodyStore&, std::size_t body);
  CellRect cells_near(const BodyStore&, std::size_t body) const;
  bool any_cell_moves(const CellRect&) const;

  const surface::Field& field_;
  float dt_s_;
  Vec3 gravity_;
  int sleeping_count_ = 0;
  unsigned change_count_ = 0;
  bool any_woken_ = false;  // since the contacts were last sorted
  ContactList pair_contacts_, static_contacts_;
  std::vector<char> has_active_neighbour_;    // has a neighbour that moves
  std::vector<char> is_supported_;            // touches something, or nothing pulls it
  std::vector<CellRect> cells_near_sleeper_;  // under and beside each sleeper
  std::vector<std::uint8_t> row_moves_;
};

}  // namespace smartsurf::world

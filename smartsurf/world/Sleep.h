// Puts resting bodies to sleep and wakes them again.
//
// A body falls asleep when it has been nearly still for kTimeToSleep_s on cells that do not move, and its
// velocity has hardly changed meanwhile: a body that starts to slide or roll is slow too, and one that swings
// on elastic tops has a mean velocity of 0. All that it touches, has a joint with or lies on, at whatever
// height, must be as still. A sleeping body has zero inverse mass in the solver and is not simulated; its
// contacts are kept with their impulses. It wakes when a cell under or beside it moves, when a neighbour
// moves, or when a body wakes on which it lies. A wrench on one of its island, an imminent hit by a fast
// body, a body placed against it, or the removal of a neighbour wakes the island.
//
// Not thread-safe except where a function says so.
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "smartsurf/surface/Field.h"
#include "smartsurf/world/RestLoads.h"
#include "smartsurf/world/SleepingContacts.h"
#include "smartsurf/world/body/BodyStore.h"
#include "smartsurf/world/contact/Contact.h"
#include "smartsurf/world/field/SupportPatch.h"
#include "smartsurf/world/parallel/IndexRange.h"

namespace smartsurf::world {

class Sleep {
 public:
  // `field` must outlive the object. `rest_scale`: of the speeds and accelerations below which a body rests.
  // If not enabled, no body falls asleep.
  Sleep(const surface::Field& field, const RestLoads::Settings& settings, float rest_scale = 1.0F,
        bool is_enabled = true)
      : field_(field),
        dt_s_(settings.dt_s),
        gravity_(settings.gravity),
        up_(settings.gravity.isZero(0.0F) ? Vec3(0, 0, 0) : Vec3(-settings.gravity.normalized())),
        rest_scale_(rest_scale),
        is_enabled_(is_enabled),
        rest_loads_(settings) {}

  bool any_asleep() const { return sleeping_count_ > 0; }
  int sleeping_count() const { return sleeping_count_; }
  // Contacts between sleeping bodies, their static contacts and support patches, as of the moment
  // they fell asleep, but with balanced loads.
  const SleepingContacts& contacts() const { return contacts_; }
  // Version numbers of the sleeping set, and of its contacts.
  unsigned set_version() const { return set_version_; }
  unsigned contacts_version() const { return contacts_version_; }
  const RestLoads& rest_loads() const { return rest_loads_; }

  // ---- before a step; `pair_contacts` and `static_contacts` are those of the previous step
  // Wakes the body, those that joints connect with it, and whatever lies on any of them.
  void wake(BodyStore&, std::size_t body);
  // Also wakes every sleeping body connected to it by contacts.
  void wake_island(BodyStore&, std::size_t body);
  // Also wakes the islands of the bodies that have a contact or joint with it, and all bodies if it is
  // static. Must be called before a body is placed or removed, and after it is added.
  void wake_with_neighbours(BodyStore&, std::size_t body, const ContactList& pair_contacts,
                            const ContactList& static_contacts);
  // Wakes the islands of bodies with a nonzero wrench.
  void wake_forced(BodyStore&);
  void wake_on_moving_cells(BodyStore&);
  // Moves the contacts and support patches of woken bodies back to the lists, so that they warm-start the
  // solver.
  void restore_contacts(ContactList& pair_contacts, ContactList& static_contacts, SupportPatches& supports);

  // ---- after a step, in this order: per active body, per range of static manifolds, once. The first two may
  // run concurrently for different bodies.
  void update_sleep_timer(BodyStore&, std::size_t body) const;
  // Bodies on moving cells must not fall asleep. `manifolds`: range in static_contacts.manifolds.
  void reset_timers_on_moving_cells(BodyStore&, const ContactList& static_contacts,
                                    IndexRange manifolds) const;
  // Nor those that swing on elastic tops.
  void reset_timers_on_patches(BodyStore&, const SupportPatches&) const;
  // Puts bodies to sleep whose timer has run out, and wakes sleepers that touch a moving body. Calls
  // find_loads() before it reads those of support patches. Islands of the direct solver sleep whole: what
  // remains awake of one would be left to the sweeps.
  void update_sleeping_set(
      BodyStore&, const std::vector<std::int32_t>& active_bodies, const ContactList& pair_contacts,
      const ContactList& static_contacts, std::span<const SupportPatches> = {},
      const std::function<void()>& find_loads = [] {}, std::span<const IslandBody> direct_islands = {});
  void on_body_removed(std::int32_t body);

  void archive(common::StateArchive& a) {
    a(sleeping_count_, set_version_, contacts_version_, woken_, placed_, contacts_, cells_near_sleeper_);
    has_sleeper_list_ = false;
  }

  // True if the body is fast enough that a hit must wake the whole island.
  static bool is_fast(const BodyStore&, std::size_t body);

 private:
  struct CellRect {
    std::int32_t row_begin = 0, row_end = 0, column_begin = 0, column_end = 0;
  };
  // The bodies of a manifold of which one lies on the other; −1 if none does.
  struct Stacked {
    std::int32_t above = -1, below = -1;
  };
  Stacked stacked(const Manifold&, const Contact& first) const;
  bool touches_moving_cell(const Contact&) const;
  void wake_alone(BodyStore&, std::int32_t body);
  void wake_where_placed(BodyStore&, const ContactList& pair_contacts);
  void keep_pushed_awake(BodyStore&, const std::vector<std::int32_t>& active_bodies,
                         const ContactList& pair_contacts);
  void keep_awake_with_others(const BodyStore&, const ContactList& pair_contacts,
                              std::span<const IslandBody> direct_islands);
  void put_to_sleep(BodyStore&, std::size_t body);
  CellRect cells_near(const BodyStore&, std::size_t body) const;
  bool cell_moves(Index cell) const;
  // True if any of the cells [first, first + count) moves.
  bool any_moves(std::size_t first, std::size_t count) const;
  IndexRange find_moving_columns(int row) const;
  bool any_cell_moves(const CellRect&) const;
  const std::vector<std::int32_t>& sleepers(const BodyStore&);

  const surface::Field& field_;
  float dt_s_;
  Vec3 gravity_, up_;  // up_: unit, against gravity; 0 without gravity
  float rest_scale_;
  bool is_enabled_;
  int sleeping_count_ = 0;
  unsigned set_version_ = 0, contacts_version_ = 0;
  std::vector<std::int32_t> woken_;   // since the last restore_contacts()
  std::vector<std::int32_t> placed_;  // since the last step
  SleepingContacts contacts_;
  RestLoads rest_loads_;
  std::vector<std::int32_t> fallen_;          // asleep, in this step
  std::vector<char> has_active_neighbour_;    // touches a moving body
  std::vector<char> is_pushed_;               // by what is driven, also by way of others
  std::vector<char> is_supported_;            // touches anything, or there is no gravity
  std::vector<CellRect> cells_near_sleeper_;  // under and beside each sleeper; indexed by body
  std::vector<IndexRange> moving_columns_;    // by row of the field: outside of them no cell moves
  std::vector<std::int32_t> sleepers_;        // ascending, as of sleeper_version_
  unsigned sleeper_version_ = 0;              // of set_version_
  bool has_sleeper_list_ = false;
};

}  // namespace smartsurf::world

// Contacts with tips that yield: tips of delta robots that are compliant, or whose joints have limited force.
//
// A tip has no mass. Its joints hold it through a spring of stiffness k and a damper c. While it is loaded,
// the impulse J of all its contacts in a substep h and the rates u of its deflection d before and u' after it
// fulfil
//   J/h = k·(d + h/4·(u' − u)) + c·u',  d' = d + h·u'
// The load has the velocity u as well, so this is the trapezoidal rule of the load on its spring: it swings
// without numerical damping at any stiffness. To its contacts the tip is a body of mass M = h·(c + h·k/4). A
// rigid tip has 1/M = 0.
//
// No mass moves with the tip where its load leaves it, slides across it, or makes the joints yield: J is then
// given, and without a load's inertia the trapezoidal rule would swing from substep to substep. Along these
// directions the tip moves by the implicit Euler method, u' = (J/h − k·d)/(c + h·k), M = h·(c + h·k).
//
// When the normal impulses add up to F·h, with the force limit F, the joints yield: the tip moves with its
// load, until the joints reach the boundary of the workspace, which bears any load. (E. Catto, Soft
// Constraints, GDC 2011.)
//
// The contacts of a tip share its velocity and are solved one after another, in the stages of Solver.h;
// threads share the islands of tips that bodies connect. They are inelastic: what springs back is the tip.
#pragma once

#include <span>
#include <vector>

#include "smartsurf/surface/Field.h"
#include "smartsurf/world/parallel/Team.h"
#include "smartsurf/world/solver/PointContact.h"

namespace smartsurf::world {

class TipSolver {
 public:
  // Finds the contacts of the coming step. On one thread.
  void collect(const surface::Field& field, const ContactList& static_contacts);
  // Call when no collect() follows in a step, because no body is active.
  void clear() { clear_contacts(), loaded_cells_.clear(), loaded_rates_.clear(); }
  bool empty() const { return points_.empty(); }

  // The islands of a member: about an even share of the contacts.
  IndexRange share(const Member&) const;
  // The stages of a step, for some islands; threads may call them at once for different ones. begin_step()
  // also applies the impulses of the last substep.
  void begin_step(const PointStep&, IndexRange islands);
  void solve(const PointStep&, IndexRange islands);
  void relax(const PointStep&, IndexRange islands);  // call after the rows were moved
  // Writes the impulses to the contacts, and the velocities of the loaded tips to the field, after the step.
  void store(surface::Field&, ContactList& static_contacts, float dt_s);
  // The cells of the loaded tips.
  std::span<const std::int32_t> cells() const { return cells_; }

  void archive(common::StateArchive& a) { a(loaded_cells_, loaded_rates_); }

 private:
  struct Tip {
    const surface::CellTip* kind;
    // The position is that at the start of the substep, the velocity that planned for the step.
    Vec3 held_position, held_velocity, deflection;
    Vec3 rate{0, 0, 0};           // u, in the last substep, along directions_with_load()
    Mat3 response{Mat3::Zero()};  // 1/M, in this substep
    Vec3 spring_rate{0, 0, 0};    // what the spring takes off J/M
    float max_impulse = 0.0F;
    Vec3 load{0, 0, 0}, normal_load{0, 0, 0};  // J, and its part without friction, mass·u/s
    Vec3 yield_velocity{0, 0, 0};              // of the joints, in the substep, u/s
    // Contacts press on it; friction holds one of them; their normal impulses reach the limit.
    bool is_loaded = false, sticks = false, is_overloaded = false;
    bool response_changed = false;  // since the last substep
    // Motion in the step, u.
    Vec3 start_deflection, moved_deflection{0, 0, 0}, yielded{0, 0, 0}, moved{0, 0, 0};

    // The load without what the boundary of the workspace bears.
    Vec3 deflecting_load() const;
    // The rate of deflection of a loaded tip.
    Vec3 deflection_rate() const;
    // Projects on the directions in which the load moves with the tip: that of the normal load, and those
    // across it where friction holds.
    Mat3 directions_with_load() const;
    void begin_substep(float h_s);
    // Also of a tip that its load has left, or slides across, in this substep.
    Vec3 rate_in_substep(float h_s) const;
    void add_load(const Vec3& impulse, const Vec3& normal_impulse) {
      load += impulse, normal_load += normal_impulse;
    }
    Vec3 velocity() const { return held_velocity + yield_velocity + deflection_rate(); }
    // How far the joints may move along a unit direction without leaving the workspace, u.
    float room_along(const Vec3& direction) const;
  };
  struct Point : PointContact {
    std::int32_t tip;
  };

  // Tips that bodies connect with each other, and their contacts.
  struct Island {
    std::int32_t first_point, first_tip;  // in points_ and tip_order_
  };

  void clear_contacts() { points_.clear(), tips_.clear(), cells_.clear(), islands_.assign(1, {0, 0}); }
  void find_islands();
  std::span<Point> points_of(IndexRange islands) {
    const std::int32_t begin = islands_[islands.begin].first_point, end = islands_[islands.end].first_point;
    return std::span(points_).subspan(begin, end - begin);
  }
  // Calls each(tip) for the tips of the islands.
  template <class Each>
  void for_each_tip(IndexRange islands, Each each) {
    for (std::int32_t k = islands_[islands.begin].first_tip; k < islands_[islands.end].first_tip; ++k)
      each(tips_[tip_order_[k]]);
  }
  void classify_loads(IndexRange islands);
  Vec3 relative_velocity(const Point&, const PointStep&) const;
  void add_normal_impulse(Point&, float impulse, const PointStep&);
  // The contact is to separate at least at `target_speed`.
  void solve_point(Point&, float target_speed, const PointStep&);
  void yield(Point&, float target_speed, const PointStep&);

  std::vector<Point> points_;  // by island, then in the order of the contacts
  std::vector<Tip> tips_;
  std::vector<Island> islands_{{0, 0}};                                 // one more at the end
  std::vector<std::int32_t> tip_order_;                                 // by island
  std::vector<std::int32_t> tip_parent_, island_of_tip_, tip_of_body_;  // of find_islands()
  std::vector<std::int32_t> cells_;                                     // of tips_
  std::vector<std::int32_t> tip_of_cell_;                               // −1: none; all −1 between steps
  // The tips that were loaded at the end of the last step, and their rates.
  std::vector<std::int32_t> loaded_cells_;
  std::vector<Vec3> loaded_rates_;
};

}  // namespace smartsurf::world

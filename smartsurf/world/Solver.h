// Solves the contacts of one step and finds how the bodies move by it: sequential impulses over a few short
// substeps.
//
// In each substep every contact is solved once towards the gap that it will have at the substep's end,
// overlaps being pushed apart softly, then the bodies move, then every contact is relaxed once, so that the
// push leaves no speed behind. Impulses carry over from substep to substep and from step to step. The rebound
// comes last.
#pragma once

#include <vector>

#include "smartsurf/world/Bodies.h"
#include "smartsurf/world/Borders.h"
#include "smartsurf/world/Contact.h"
#include "smartsurf/world/Schedule.h"
#include "smartsurf/world/Slabs.h"
#include "smartsurf/world/Team.h"

namespace smartsurf::world {

struct StepSettings {
  float dt_s;
  int substeps;
  Vec3 gravity;                                                      // u/s²
  float field_friction_root, field_rolling_root, field_restitution;  // of the surface and the ground
};

class Solver {
 public:
  explicit Solver(const StepSettings& settings)
      : settings_(settings),
        field_{0.0F, settings.field_friction_root, settings.field_rolling_root, settings.field_restitution} {}

  struct Input {
    const Slabs& slabs;  // with their rows listed
    ContactList &pairs, &world;
    const SlabRuns &pair_runs, &world_runs;
    bool limited;  // whether any contact has a limit
    bool pushed;   // whether any body has a wrench
  };
  // One step. The lists come back with the impulses of the last substep and the sums of the step; how each
  // body moves stays in its row. All members of the team together.
  void step(BodyStore&, const Input&, const Member&);
  // Hands the body of a row its motion.
  void hand_back(BodyStore&, const Slabs&, int row) const;

 private:
  struct Job;
  void make_room(const Slabs&, int members);
  void work(Job&, const Member&);
  void fill(Job&, ContactKind, int octet);
  void set_bodies(Job&, Octet&, int index, ContactKind);
  void clear_points(const Octet&);
  void clear_details(const Octet&, bool all);
  // What of each point is filled in.
  struct Parts {
    bool points, surface, details;
  };
  void fill_lane(const Job&, Octet&, int lane, const Manifold&, const std::vector<Contact>&, const Parts&);
  void fill_limits(Octet&, int index, const ContactList&);
  void read_back(Job&, ContactKind, int octet);
  template <class Each>
  void for_moving(const Job&, Each each) const;
  void load_rows(Job&);
  Motion pushed(const Job&, int row) const;
  void begin_substep(Job&, bool first);
  void advance(Job&);
  void sweep(Job&, const Member&, const Kernel (&)[kContactKinds], float elapsed_s);

  Points points() { return {point_.data(), detail_.data()}; }
  BodyRows rows() { return {motion_.data(), shift_.data(), inertia_.data()}; }

  StepSettings settings_;
  Grip field_;
  Schedule schedule_;
  Borders borders_;
  std::vector<Point> point_;
  std::vector<PointDetail> detail_;
  // One a row of the slabs: what the passes read lies near what they read next.
  std::vector<Motion> motion_;
  std::vector<Shift> shift_;
  std::vector<Inertia> inertia_;
  std::vector<Grip> grip_;
  std::vector<Motion> start_;  // before the contacts of the substep
};

}  // namespace smartsurf::world

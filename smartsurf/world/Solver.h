// Solves the contacts of one step and finds how the bodies move by it: sequential impulses over a few short
// substeps.
//
// In each substep every contact is solved once towards the gap that it will have at the substep's end,
// overlaps being pushed apart softly, then the bodies move, then every contact is relaxed once, so that the
// push leaves no speed behind. Impulses carry over from substep to substep and from step to step. The rebound
// comes last.
#pragma once

#include <memory>
#include <vector>

#include "smartsurf/world/Bodies.h"
#include "smartsurf/world/Contact.h"
#include "smartsurf/world/Schedule.h"
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
  explicit Solver(const StepSettings& settings) : settings_(settings) {}

  // One step. `moving`: the bodies that move, each once, ascending. The lists come back with the impulses of
  // the last substep and the sums of the step; velocities are those at its end, and BodyStore::shift says how
  // far each body gets. `limited`: whether any contact has a limit. All members of the team together.
  void step(BodyStore&, const std::vector<std::int32_t>& moving, ContactList& pairs, ContactList& world,
            bool limited, const Member&);

 private:
  struct Job;
  void work(Job&, const Member&);
  void fill(Job&, int octet);
  void clear_points(const Octet&);
  void fill_lane(Job&, const Octet&, int lane, const Manifold&, const std::vector<Contact>&);
  void fill_limits(Octet&, int index, const ContactList&);
  void read_back(Job&, int octet);
  void begin_substep(Job&, Range, bool first);
  void advance(Job&, Range);
  void end_substep(Job&, Range);
  void sweep(Job&, const Member&, const Kernel (&)[kContactKinds], float elapsed_s);

  Points points() { return {point_.data(), detail_.data()}; }

  StepSettings settings_;
  Schedule schedule_;
  std::vector<Point> point_;
  std::vector<PointDetail> detail_;
};

}  // namespace smartsurf::world

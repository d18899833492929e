// Contacts of bodies with joints.
//
// A stage solves the joints of a tree exactly and then sweeps the contacts once, which takes the bodies off
// their joints again: a heavy chain would sink into what it meets, and what puts its joints right afterwards
// turns into energy. Here the two take turns until they agree. Each turn removes what is left of one kind of
// error without adding energy; what is left is greatest where one contact bears many links, and the impulses
// carry over to the next substep.
//
// Only loads carry over, the impulses that two substeps in a row have borne: a blow that struck once more
// would set the chain in motion, and the turns are too few to take that back.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "smartsurf/world/body/BodyStore.h"
#include "smartsurf/world/broadphase/SpatialPartition.h"
#include "smartsurf/world/solver/ConstraintGraph.h"
#include "smartsurf/world/solver/ContactBatch.h"

namespace smartsurf::world {

class JointedContacts {
 public:
  // Notes the contacts of active bodies with joints. Call once all batches are prepared. `solved_rows`: see
  // HeavyIslandSolver; what it has solved stays as it is. It is read until the next call.
  void collect(const ConstraintGraph&, const BodyStore&, const SpatialPartition&, BatchPoints,
               const BodyVelocity*, std::span<const char> solved_rows);
  bool empty() const { return points_.empty(); }
  bool is_solved(std::int32_t row) const {
    return !solved_rows_.empty() && row >= 0 && solved_rows_[static_cast<std::size_t>(row)] != 0;
  }
  // By row: whether a noted contact touches the body.
  std::span<const char> touched_rows() const { return is_touched_; }

  // After a substep has applied the impulses of the last one again: lowers each to that of the substep
  // before.
  void keep_loads(BatchPoints, const SolverBodies&);
  // After the last substep: the next step starts from the impulses that both last substeps have borne.
  void end_step(BatchPoints);

  // Measures the separations at the start of the stage.
  void begin_stage(BatchPoints, const SolverBodies&, const SubstepParams& pair_params,
                   const SubstepParams& static_params, bool is_soft);
  // One sweep over the contacts.
  void sweep(BatchPoints, const SolverBodies&, const SubstepParams& pair_params,
             const SubstepParams& static_params, bool is_soft);

 private:
  struct Point {
    std::int32_t index, lane;  // in the batch points
    std::int32_t row[2];       // −1: does not move
    ContactKind kind;
    Vec3 normal, anchor[2];
    Mat3 inverse_inertia[2];
    float separation = 0.0F;   // at the start of the stage
    float before_last = 0.0F;  // normal impulse of the substep before the last

    Vec3 velocity(const BodyVelocity*) const;
    void apply(const Vec3& impulse, BodyVelocity*) const;
  };
  // Lowers the impulses of a point to what both last substeps have borne; returns the change.
  Vec3 lower_to_load(Point&, BatchPoints) const;
  bool is_solved(const Point& p) const { return is_solved(p.row[0]) || is_solved(p.row[1]); }

  struct Lane {
    std::pair<int, int> rank;  // ConstraintGraph::rank(): contacts are swept in its order
    int batch, lane;
    ContactKind kind;
  };

  std::vector<Lane> lanes_;  // with a body that has joints
  std::vector<Point> points_;
  std::vector<char> is_touched_;
  std::span<const char> solved_rows_;
};

}  // namespace smartsurf::world

// Contacts of bodies with joints.
//
// A stage solves the joints of a tree exactly and then sweeps the contacts once, which takes the bodies off
// their joints again: a heavy chain would sink into what it meets, and what puts its joints right afterwards
// turns into energy. Here the two take turns until they agree, in each island by itself; threads share the
// islands. Each turn removes what is left of one kind of error without adding energy; what is left is
// greatest where one contact bears many links, and the impulses carry over to the next substep. The
// changes of the impulses there soon form a geometric series; the rest of the series is applied at once (A.
// C. Aitken, 1926).
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
#include "smartsurf/world/parallel/SlabQueue.h"
#include "smartsurf/world/parallel/Team.h"
#include "smartsurf/world/solver/ConstraintGraph.h"
#include "smartsurf/world/solver/ContactBatch.h"
#include "smartsurf/world/solver/JointSolver.h"
#include "smartsurf/world/solver/SupportSolver.h"

namespace smartsurf::world {

class JointedContacts {
 public:
  // Notes the contacts and the support patches of active bodies with joints. Call once all batches are
  // prepared. `supports`: by member; they stay where they are until the next call. `solved_rows`: see
  // HeavyIslandSolver; what it has solved stays as it is. It is read until the next call.
  struct Input {
    const ConstraintGraph& graph;
    const BodyStore& bodies;
    const SpatialPartition& partition;
    BatchPoints points;
    const BodyVelocity* rows;
    const JointSolver& joints;
    std::span<std::vector<SupportBatch>> supports;
    std::span<const char> solved_rows;

    // Active, and with joints.
    bool is_jointed(std::int32_t row) const {
      const std::size_t body = partition.body(row);
      return bodies.is_jointed[body] && bodies.is_active(body);
    }
  };
  void collect(const Input&);
  bool empty() const { return points_.empty(); }

  // After a substep has applied the impulses of the last one again: lowers each to that of the substep
  // before.
  void keep_loads(BatchPoints, const SolverBodies&);
  // After the last substep: the next step starts from the impulses that both last substeps have borne.
  void end_step(BatchPoints);

  struct Stage {
    BatchPoints points;
    SolverBodies rows;
    const SubstepParams &pair_params, &static_params;
    bool is_soft;
    JointSolver& joints;
    JointSolver::Rows joint_rows;
  };
  // Call from one thread before each settle(), while no member is in it.
  void begin_settle(const Member& member) { queue_.reset(member.member_count); }
  // Joints and contacts take turns, in each island until they agree. Called by all members, each of which
  // takes some of the islands; nobody may use their bodies meanwhile.
  void settle(const Stage&, const Member&);

 private:
  struct Point {
    std::int32_t index, lane;  // in the batch points
    std::int32_t row[2];       // −1: does not move
    ContactKind kind;
    Vec3 normal, anchor[2];
    Mat3 inverse_inertia[2];
    // A unit impulse along the normal on the first side has this torque on each side, which gives this spin.
    Vec3 normal_torque[2], normal_spin[2];
    float separation = 0.0F;   // at the start of the stage
    float before_last = 0.0F;  // normal impulse of the substep before the last
    Vec3 change, last_change;  // of the impulse, by the last two sweeps

    Vec3 velocity(const BodyVelocity*) const;
    void apply(const Vec3& impulse, BodyVelocity*) const;
    // The same along the normal.
    float normal_speed(const BodyVelocity*) const;
    void apply_normal(float impulse, BodyVelocity*) const;
  };
  struct Lane {
    std::int32_t root;         // of its island
    std::pair<int, int> rank;  // ConstraintGraph::rank(): the contacts of an island are swept in its order
    int batch, lane;
    ContactKind kind;
  };
  // ---- by root: the least row of an island
  struct Tree {
    std::int32_t root, index;
  };
  struct Support {
    std::int32_t root, lane;
    SupportBatch* batch;
  };
  // Up to kLanes support patches of one island, apart from those of other islands in their batches.
  struct SupportGroup {
    SupportBatch batch;
    int first = 0;  // in supports_
  };
  // What joints and noted contacts connect; bodies that cannot move connect nothing. No two islands change
  // the same row, tree or lane, so threads may settle them at once.
  struct Island {
    std::int32_t root;
    IndexRange points, trees, groups;
  };
  void unite_rows(const Input&);
  void add_points(const Input&, const Lane&);
  void collect_trees(const JointSolver&);
  void collect_supports(const Input&);
  void settle(const Island&, const Stage&);
  void begin_stage(const Island&, const Stage&);
  // One sweep over the contacts. Returns the share of the last sweep's changes of the impulses that this one
  // has repeated.
  double sweep(const Island&, const Stage&);
  // Changes the impulses once more as the last sweep has, times `factor`.
  void repeat_change(const Island&, const Stage&, float factor);
  void solve_supports(const Island&, const Stage&);
  bool is_solved(std::int32_t row) const {
    return !solved_rows_.empty() && row >= 0 && solved_rows_[static_cast<std::size_t>(row)] != 0;
  }
  // Lowers the impulses of a point to what both last substeps have borne; returns the change.
  Vec3 lower_to_load(Point&, BatchPoints) const;
  bool is_solved(const Point& p) const { return is_solved(p.row[0]) || is_solved(p.row[1]); }

  std::vector<Lane> lanes_;  // with a body that has joints
  std::vector<Point> points_;
  std::vector<Island> islands_;
  std::vector<Tree> trees_;  // that contacts touch
  std::vector<Support> supports_;
  std::vector<SupportGroup> groups_;
  std::vector<std::int32_t> parent_;  // by row: union-find, in which the least row of a set is its root
  std::vector<char> is_touched_;      // by row: whether a noted contact touches the body
  std::span<const char> solved_rows_;
  SlabQueue queue_;  // of islands
};

}  // namespace smartsurf::world

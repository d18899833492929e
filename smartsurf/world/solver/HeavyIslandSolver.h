// A direct solver for islands in which sequential impulses converge slowly.
//
// Sequential impulses need about n² sweeps to carry a load through a chain of n bodies, as many as the ratio
// of the masses through a light body, and as many as the ratio of the moments of inertia to stop a tilt over
// a narrow base; and contacts are as soft as bodies are light. The missing impulse moves the bodies: a tonne
// sinks into a table on four legs of a kilogram, and a corbel falls. In such islands the normal impulses are
// solved at once after each sweep: the velocity changes of all bodies, with the contacts as springs in series
// with the rigid bodies, and the set of contacts that bear, and of those that stick, by iteration (an active
// set). The springs of elastic tops, and joints, as hard springs along the rows that they hold, are solved
// with them.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "smartsurf/world/body/BodyStore.h"
#include "smartsurf/world/broadphase/SpatialPartition.h"
#include "smartsurf/world/field/SupportPatch.h"
#include "smartsurf/world/parallel/SlabQueue.h"
#include "smartsurf/world/parallel/Team.h"
#include "smartsurf/world/solver/BlockCholesky.h"
#include "smartsurf/world/solver/ConstraintGraph.h"
#include "smartsurf/world/solver/ContactBatch.h"
#include "smartsurf/world/solver/JointSolver.h"
#include "smartsurf/world/solver/SupportSprings.h"

namespace smartsurf::world {

class HeavyIslandSolver {
 public:
  // A load heavier than this many times the weight of the body that bears it makes an island heavy, a lesser
  // one where it is off the middle of the base, and so does a body that bears one heavier by the ratio.
  static constexpr float kHeavyLoad = 16.0F, kOffCentreLoad = 2.5F, kHeavyRatio = 16.0F;
  static bool is_unequal(float inverse_mass, float other) {
    return std::min(inverse_mass, other) > 0.0F &&
           std::max(inverse_mass, other) > kHeavyRatio * std::min(inverse_mass, other);
  }
  // True if the lighter one of two unequal bodies lies below the other. `normal`: from b to a.
  static bool is_pressed(float inverse_mass_a, float inverse_mass_b, const Vec3& normal,
                         const Vec3& gravity) {
    return is_unequal(inverse_mass_a, inverse_mass_b) &&
           (inverse_mass_a > inverse_mass_b ? 1.0F : -1.0F) * normal.dot(gravity) > 0.5F * gravity.norm();
  }
  // Larger islands, and those beyond the sum, are left to the sweeps.
  static constexpr int kMaxBodies = BlockCholesky::kMaxRows, kMaxBodiesInAll = 256;

  void reset(int member_count, int row_count, int batch_count);
  struct Step {
    const ConstraintGraph& graph;
    const BodyStore& bodies;
    const SpatialPartition& partition;
    BatchPoints points;
    const BodyVelocity* velocity;
    std::span<SupportPatches> supports;
    const JointSolver& joints;
    Vec3 gravity;
    float h_s;
  };
  // Notes the lanes of a prepared batch in which a body bears a heavy load, touches a body that much heavier,
  // lies on a narrow base, or meets what it lies on. Called by the member that prepares the batch.
  void find_heavy_lanes(const Step&, int batch, ContactKind, const SubstepParams&, const Member&);
  bool any_heavy_lane() const;
  // Builds the islands of the noted lanes. Called by all members after they have prepared their batches.
  void build(const Step&, IndexRange own_rows, const Member&);
  bool empty() const { return islands_.empty(); }
  // The islands of the step, one after the other.
  std::span<const IslandBody> bodies() const { return bodies_; }

  // A sweep of the solve stage (soft) or the relax stage.
  struct Substep {
    const SubstepParams &pair_params, &static_params;
    bool is_soft;
    JointSolver& joints;
    BodyVelocity* start_velocity;  // see JointSolver::Rows
  };
  // Call from one thread before each solve(), while no member is in it.
  void begin_solve() { queue_.reset(static_cast<int>(members_.size())); }
  // Corrects the impulses after a sweep. Called by all members, each of which solves some of the islands;
  // nobody may use the bodies of the islands meanwhile.
  void solve(const BatchPoints&, const SolverBodies&, const Substep&, const Member&);
  // By row: whether the last solve() has found the impulses of its body. Empty without islands.
  std::span<const char> solved_rows() const {
    return islands_.empty() ? std::span<const char>() : is_solved_;
  }

 private:
  // A lane with a point that bears or touches.
  // A load deflects a contact at most this far, u.
  static constexpr float max_deflection(ContactKind kind) { return 0.5F * slop_of(kind); }
  struct BearingLane {
    std::int32_t batch, lane;
    ContactKind kind;
    std::pair<int, int> rank;  // see ConstraintGraph::rank()
  };
  // A body that meets what it lies on, and the flag of its set if nothing bears it yet.
  struct Fresh {
    std::int32_t row;
    std::uint8_t flag;
  };
  struct alignas(128) MemberData {
    std::vector<std::int32_t> heavy_rows, sinking_rows, sliding_rows, pressed_rows;
    std::vector<Fresh> fresh_rows;
    std::vector<BearingLane> lanes;  // ascending by rank
    BlockCholesky matrix;            // of the island that the member solves
    double right_side[BlockCholesky::kSize * kMaxBodies];
    std::vector<LinearLoad> loads;  // of the elastic patches of that island
    std::vector<char> bears;        // by load
  };
  // A spring in series with the rigid bodies: its stiffness (impulse per speed) and the speed that it lacks.
  struct Spring {
    double stiffness = 0.0, error = 0.0, impulse = 0.0, change = 0.0;
  };
  // Three springs between two bodies, and their velocities per velocities of the bodies (linear, angular).
  struct Springs {
    std::int32_t body[2];  // in the island; −1: immovable
    BlockCholesky::Rows jacobian[2];
    Spring spring[3];
    bool in_matrix[3];

    // The speed that a spring still lacks with the velocity changes of the bodies.
    double lacking_speed(int k, const double* changes) const;
    // The speeds that all three springs still lack.
    void find_lacking_speeds(const double* changes, double (&lacks)[3]) const;
    void add_force(const double (&force)[3], double* right_side) const;
    // Adds the springs that are to be in the matrix and are not yet, and removes the others.
    void update(const bool (&wanted)[3], BlockCholesky& matrix);
  };
  // Along the normal and two tangents.
  struct Point : Springs {
    std::int32_t index, lane;  // in the batch points
    std::int32_t row[2];       // −1: static
    ContactKind kind;
    bool bears, sticks, stuck_again;
    bool yields;                // as a soft contact
    double least_inverse_mass;  // of the two bodies
    double least_compliance;
    double slipping_share;  // of the friction that its load allows: one that has less than this sticks again
    double steady_impulse;  // normal, of the last relax stage
    // Normal, and the vector of friction: before the sweep; during solve_island(), after it.
    float impulse[4];
    void keep(const BatchPoint&);
    Spring& normal() { return spring[0]; }
    // Takes the impulses that follow from velocity changes of the bodies; true if it now bears, lifts, sticks
    // or slips as it did not, or if it would and may not.
    bool follow(const double* changes, double friction_coefficient, bool may_switch);
  };
  // The friction of a support patch whose cells rest: along x and y, and about z.
  struct PatchFriction : Springs {
    SupportPatches* list;
    SupportPatch* patch;
    bool sticks;
    double load(std::span<const Point> island, const BatchPoints&) const;
    // The squared ratio of its friction to the greatest that the load allows, which is an ellipsoid.
    double limit_share(double load) const;
  };
  // A joint: its first three rows and its last ones, of which the very last is the axis, if it has a law.
  struct JointSprings {
    std::int32_t joint, row[2];  // −1: does not move
    Springs part[2];
    const AxisLaw* law = nullptr;
    int segment = 0;
    // The stiffness with which a segment holds the axis.
    double held_stiffness = 0.0;
    // The axis's impulse and speed before the direct solution.
    double impulse = 0.0, speed = 0.0;
    // The change of the impulse in a segment that neither holds the axis nor slopes.
    double constant = 0.0;

    Spring& axis() { return part[1].spring[2]; }
    const Spring& axis() const { return part[1].spring[2]; }
    void set_segment(int next);
    // The axis's speed with the velocity changes of the bodies.
    double axis_speed(const double* changes) const;
    // Takes the impulses that follow from velocity changes of the bodies; true if the axis now is in another
    // segment.
    bool follow(const double* changes, bool may_switch, BlockCholesky& matrix);
  };
  // A support patch on elastic tops, whose loads are springs along the vertical.
  struct ElasticPatch {
    SupportPatches* list;
    SupportPatch* patch;
    std::int32_t body;           // in the island
    std::size_t first_load = 0;  // in MemberData
    std::size_t load_count = 0;
    support::Vector3 motion = support::Vector3::Zero();     // of its face before the direct solution
    support::Matrix3 in_matrix = support::Matrix3::Zero();  // the stiffness that the matrix has of it
    void set_up(MemberData&, const SolverBodies&, const Substep&);
    // The equations of the corners that bear now.
    void assemble(const MemberData&, BlockCholesky&, double* right_side);
    support::Vector3 motion_after(const double* changes) const;
    // Returns whether a corner now bears or lifts as it did not.
    bool follow(MemberData&, const double* changes) const;
    void apply(const MemberData&, const double* changes, const SolverBodies&, bool is_soft) const;
  };
  struct Island {
    int min_bodies;  // smaller ones are left to the sweeps
    std::int32_t body_count = 0, first_body = 0, first_lane = 0, lane_count = 0, first_point = 0,
                 point_count = 0, first_patch = 0, patch_count = 0, first_elastic = 0, elastic_count = 0,
                 first_joint = 0, joint_count = 0;
    double greatest_impulse = 0.0;  // of a contact, mass·u/s in a substep
    bool is_pressed = false;        // a light body bears a heavy one
    bool is_passive = true;         // nothing that moves of itself or by a joint touches it
    double least_inverse_mass = 1e30;
    bool is_prepared = false;  // what stays through the step
  };

  std::int32_t find_root(std::int32_t row);
  void unite(std::int32_t row, std::int32_t other);
  void mark(std::int32_t row, std::uint8_t flag);
  void find_own_lanes(const Step&, const Member&);
  void mark_islands(const Step&, IndexRange own_rows, const Member&);
  void number_islands(const Step&);
  // The place of a row's body in its island; −1: in none, or immovable.
  std::int32_t body_of(const Step& step, std::int32_t row) const {
    return step.velocity[row].inverse_mass > 0.0F ? body_of_row_[row] : -1;
  }
  void merge_lanes();
  void order_lanes(const Step&);
  void collect_points(const Step&, Island&);
  void collect_patches(std::span<SupportPatches>);
  void collect_joints(const Step&);
  void share_islands();
  IndexRange share_of(int member) const { return {share_begin_[member], share_begin_[member + 1]}; }
  struct IslandContacts {
    std::span<Point> points;
    std::span<PatchFriction> patches;
    std::span<JointSprings> joints;
  };
  void prepare_island(const Island&, const BatchPoints&, const SolverBodies&, BlockCholesky& bodies);
  void solve_island(const Island&, const BatchPoints&, const SolverBodies&, const Substep&,
                    const BlockCholesky& bodies, MemberData&);
  bool find_changes(const Island&, const IslandContacts&, const BatchPoints&, bool with_friction,
                    MemberData&);
  // The kinetic energy at the start of the substep, and what the contacts add to it if they are scaled:
  // linear·share + quadratic·share².
  struct Energy {
    double start = 0.0, linear = 0.0, quadratic = 0.0;
    bool grows() const { return linear + quadratic > 1e-6 * start; }
    double passive_share() const { return std::clamp(-linear / quadratic, 0.0, 1.0); }
  };
  Energy energy_of_contacts(const Island&, const SolverBodies&, const Substep&) const;
  void scale_impulses(const Island&, const IslandContacts&, const BatchPoints&, const SolverBodies&,
                      const Substep&, double share) const;
  void note_solved(const Island&, bool is_solved);
  // Takes back what the sweep has done, or does it again: it makes friction in a stack at rest that the
  // direct solution would have to take out again.
  static void exchange_impulses(std::span<Point>, const BatchPoints&, const SolverBodies&);
  static void set_axes(Point&, const BatchPoints&, const SolverBodies&, const Island&);
  static void set_up(Point&, const BatchPoints&, const SolverBodies&, const SubstepParams&, bool is_soft);
  static void set_up(const IslandContacts&, const BatchPoints&, const SolverBodies&, const Substep&,
                     const Island&, bool with_friction, BlockCholesky&);
  static void set_stiffness(Point&, const BatchPoints&, const SubstepParams&, double blow);
  static void set_up(PatchFriction&, const SolverBodies&);
  static void set_up(JointSprings&, const SolverBodies&, const Substep&);
  // The equations of what bears and sticks now.
  static void assemble(const IslandContacts&, BlockCholesky&, std::span<double> right_side);
  static void apply(const IslandContacts&, const double* changes, const BatchPoints&, const SolverBodies&,
                    const Substep&);

  std::vector<MemberData> members_;
  std::vector<std::uint8_t> bearing_lanes_;        // by batch; bit i: a point of lane i bears or touches
  std::vector<BearingLane> lanes_, merged_lanes_;  // of the islands, island by island; of all, both by rank
  std::vector<std::int32_t> parent_;  // by row: union-find, in which the least row of a set is its root
  std::vector<std::uint8_t> flags_;   // by row, of roots
  std::vector<std::uint8_t> is_borne_, is_pressed_;  // by row
  std::vector<std::int32_t> island_of_row_, body_of_row_;
  std::vector<Island> islands_;
  // By member: the first island of its share, and their number at the end. Islands follow each other in the
  // order of the rows, so that those of a share lie together in space.
  std::vector<std::int32_t> share_begin_;
  SlabQueue queue_;                 // of islands
  std::vector<std::int32_t> rows_;  // of the islands' bodies
  std::vector<IslandBody> bodies_;  // in the same order
  std::vector<Point> points_;       // of each island as many as its lanes may have, some of them unused
  std::vector<PatchFriction> patches_;
  std::vector<ElasticPatch> elastic_patches_;
  std::vector<JointSprings> joints_;
  std::vector<char> is_solved_;          // by row
  std::vector<BlockCholesky> matrices_;  // by island, without springs; more remain of earlier steps
};

}  // namespace smartsurf::world

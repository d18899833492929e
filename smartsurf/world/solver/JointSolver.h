// Joints of the native engine: constraints between two bodies, or between a body and the table.
//
// A joint has rigid rows, which its kind forbids to move, and at most one axis row, its coordinate
// (scene/JointSpec.h). All rows of the bodies that joints connect with each other, a tree, are solved at once
// (JointEquations.h); threads share the trees. An AxisLaw is piecewise linear; its
// segment is chosen so that the solution obeys all laws, beginning with that of the last substep.
//
// In each substep solve() finds the impulses, along the constraints at its start, with which they hold at its
// end, on the curved path of the bodies, and the coordinates that motors, friction or limits hold have moved
// at the right speed; relax() removes the velocity across the constraints at its end. This is RATTLE (H. C.
// Andersen, 1983): of second order, without drift of the energy. Springs are integrated by the trapezoidal
// rule: their energy neither grows nor decays, at any stiffness. Within a step, bodies with joints rotate
// substep by substep.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "common/state/StateArchive.h"
#include "smartsurf/scene/JointSpec.h"
#include "smartsurf/world/body/BodyStore.h"
#include "smartsurf/world/broadphase/SpatialPartition.h"
#include "smartsurf/world/field/JamRelief.h"
#include "smartsurf/world/parallel/Team.h"
#include "smartsurf/world/solver/AxisLaw.h"
#include "smartsurf/world/solver/JointEquations.h"

namespace smartsurf::world {

class JointSolver {
 public:
  // The solver's rows, see SolverBodies. `start_velocity`: before the contacts of the substep.
  struct Rows {
    BodyVelocity *velocity, *start_velocity;
    DeltaPose* delta_pose;
  };
  struct Substep {
    float h_s;
    Vec3 gravity;  // u/s²
  };

  // ---- between steps; all but state() allocate
  // The spec is in world units; its objects must be in the store. Updates the store's links.
  scene::JointId add(const scene::JointSpec&, BodyStore&);
  bool contains(scene::JointId id) const { return find(id) != nullptr; }
  bool remove(scene::JointId, BodyStore&);
  // Replaces the motor or spring of a joint with a coordinate.
  void set_motor(scene::JointId, const scene::JointMotor&);
  void set_spring(scene::JointId, const scene::JointSpring&);
  // The joint must exist. The state is in world units; forces are means over `dt_s`.
  scene::JointState state(scene::JointId, const BodyStore&, float dt_s) const;
  // Indices of the bodies a and b of the joint; −1: the table.
  std::array<std::int32_t, 2> bodies_of(scene::JointId) const;
  scene::JointKind kind_of(scene::JointId id) const { return find(id)->kind; }
  // Removes the joints of a body that was erased from the store; `body` was its index.
  void on_body_removed(std::int32_t body, BodyStore&);
  void archive(common::StateArchive&);

  // ---- within a step
  bool empty() const { return joints_.empty(); }
  // On one thread, before the others.
  void begin_step(const BodyStore&, const SpatialPartition&, int substeps);
  // The trees of a member: about an even share of the joints that move.
  IndexRange share(const Member&) const;
  // ---- for some trees; threads may call these at once for different ones
  // Call once the rows have their velocities.
  void begin_trees(const BodyStore&, const SpatialPartition&, const Rows&, IndexRange trees);
  // Applies the impulses of the last substep and solves for the end of this one.
  void solve(const BodyStore&, const Rows&, const Substep&, IndexRange trees);
  // Call after the rows were moved: rotates the bodies, and removes the velocity that the constraints forbid.
  // Writes the rotations of delta_pose.
  void relax(const Rows&, IndexRange trees);
  // Solve and relax a tree again, after contacts have changed the velocities. Return whether any joint was
  // off by more than `tolerance`, u/s. Unless it `predicts` where the speeds lead, solve_again() takes the
  // tree to the speeds along its rows that the last prediction of the substep has asked for, which is exact
  // but for the curvature of the paths.
  bool solve_again(const Rows&, std::int32_t tree, double tolerance, bool predicts);
  bool relax_again(const Rows&, std::int32_t tree, double tolerance);
  // Calls visit(tree, row) for the bodies of the trees that move, tree by tree.
  template <class Visit>
  void for_each_moving_row(Visit visit) const {
    for (std::size_t t = 0; t < tree_states_.size(); ++t)
      for (const std::int32_t i : bodies_of(equations_.trees()[t]))
        if (tree_states_[t].is_active && bodies_[i].is_active)
          visit(static_cast<std::int32_t>(t), bodies_[i].row);
  }
  // ---- for the solver of an island with joints; threads may call these at once for different trees
  // The rows of a joint with an active body, by its index among the joints, which is that of its link. The
  // speed along a row is jacobian[0]·(v, ω of a) + jacobian[1]·(v, ω of b).
  struct RowSprings {
    static constexpr double kCompliance = 1e-8;  // of a held row, relative to what the bodies give way by

    std::array<const JointEquations::Matrix6*, 2> jacobian;
    JointEquations::Vector6 stiffness;  // of a row that is held, impulse per speed; 0: no such row
    JointEquations::Vector6 speed;      // with which solve() or relax() has left the rigid rows
    const AxisLaw* law;                 // of the axis, the last row, with its segment and impulse; or null
    int segment;
    double impulse;
  };
  // Whether the joint's tree has a loop, whose rows may depend on each other. The table is in no tree.
  bool is_in_loop(std::int32_t joint) const {
    const auto has_loop = [this](const Body& b) {
      return b.tree >= 0 && equations_.trees()[b.tree].has_loop;
    };
    return has_loop(bodies_[blocks_[joint].a]) || has_loop(bodies_[blocks_[joint].b]);
  }
  RowSprings springs_of(std::int32_t joint, bool is_relaxing) const;
  // Notes an impulse that the solver has exerted along the rows, in the stage of solve() or relax(), and the
  // segment of the axis and its speed after it.
  void add_impulse(std::int32_t joint, const JointEquations::Vector6& impulse, int segment, double axis_speed,
                   bool is_relaxing);
  // ---- for impacts, after the last substep; on one thread
  // An impulse on a body, mass·u/s, and its moment about the centre of mass, mass·u²/s.
  struct Blow {
    std::int32_t body;
    Eigen::Vector3d impulse, moment;
  };
  // A joint at the nearer of its limits, from which it moves at the speed linear·(v of a − v of b) +
  // turn_a·(ω of a) − turn_b·(ω of b), of the rows.
  struct Stop {
    std::int32_t joint, tree, a, b;  // bodies; b = −1: cannot move
    Vec3 linear, turn_a, turn_b;
    float room;  // to the limit, u or rad
  };
  // What blows change of a body's row.
  struct RowChange {
    std::int32_t body, row;
    Vec3 velocity, angular_velocity;
  };
  // The tree of an active body whose joints move; −1 for other bodies.
  std::int32_t tree_of_moving(std::int32_t body) const;
  // The blow of an impulse at `anchor` from the centre of mass of a body with joints that move. The anchor is
  // that of the rows, of the body as it lay at the start of the step.
  Blow blow_at(std::int32_t body, const Vec3& anchor, const Vec3& impulse) const;
  std::span<const Blow> blows_of(const Stop&, float impulse);  // until the next call
  // Appends the tree's joints with limits.
  void find_stops(std::int32_t tree, std::vector<Stop>& stops) const;
  // Appends how the tree's active bodies respond to blows to some of them, with rigid joints. Axes are free
  // but for those that are locked: efforts of springs, motors and friction are too small to matter in an
  // instant, and limits are stops.
  void respond(std::int32_t tree, std::span<const Blow> blows, std::vector<RowChange>& changes);
  // Adds the impulses with which the joints pass the blows on to what state() gives, and the impulse of a
  // stop.
  void add_blows(std::int32_t tree, std::span<const Blow> blows);
  void add_stop(const Stop&, float impulse);
  // Calls visit(body) for the active bodies with joints.
  template <class Visit>
  void for_each_jointed(Visit visit) const {
    for (const Body& b : bodies_)
      if (b.is_active) visit(b.body);
  }
  // After the last substep: the tree of the body is to end its motion at this fraction of the step, if not
  // earlier.
  void end_early(std::int32_t body, float fraction);
  // Moves such trees back to the end of the last substep before that, where their joints hold. They keep
  // their speeds, turned back with the bodies, less what gravity and forces would have done on the rest of
  // the way: a chain that stops again and again would gain that energy each time. Leaves the momentum in the
  // rows of all trees as it is, not turned.
  void end_motion(const BodyStore&, const Rows&, const Substep&);
  // Appends, after the step, the active bodies of joints that contacts hold off their constraints by
  // `min_depth`, u, or more, with that distance. Allocates while the list grows.
  void find_strained(const BodyStore&, float min_depth, std::vector<JammedBody>&) const;

 private:
  static constexpr int kRows = 6, kAxis = 5;  // the axis's row
  using Vec3d = Eigen::Vector3d;
  using Quatd = Eigen::Quaterniond;
  using RowVector = JointEquations::Vector6;  // an entry per row, or a wrench
  using RowMatrix = JointEquations::Matrix6;

  struct Joint {
    scene::JointId id;
    scene::JointKind kind;
    bool collide, has_spring, has_motor;
    std::uint8_t held_by;      // AxisLaw::Cause
    std::int32_t a, b;         // bodies; b = −1: the table
    Vec3d anchor_a, anchor_b;  // from the centre of mass, body axes; of the table: world frame
    Quatd frame_a, frame_b;    // from the joint's axes, whose z is the axis, to the body's
    double lower, upper;       // ±infinity without limits
    double friction;
    scene::JointSpring spring;
    scene::JointMotor motor;
    // ---- state
    double coordinate;
    // Its tree stood still in the last step: it could not even make the way of a substep.
    bool stood = false;
    Vec3d force_impulse;    // of the rigid rows on a, over the step
    double effort_impulse;  // along the axis, over the step

    bool has_coordinate() const {
      return kind == scene::JointKind::kHinge || kind == scene::JointKind::kSlider;
    }
    bool is_locked() const { return lower == upper; }
  };
  struct Pose {
    Vec3d position{0, 0, 0};
    Quatd orientation{1, 0, 0, 0};
  };
  // A body with joints, in double precision. The first one is the table.
  struct Body {
    std::int32_t body = -1, row = -1, tree = -1;
    bool is_active = false, is_sphere = true;
    double inverse_mass = 0.0;
    Pose start, now, next;  // at the start of the step, at present, and where the substep leads
    Vec3d velocity{0, 0, 0}, angular_velocity{0, 0, 0};
    // Solver rows hold the angular momentum as a velocity of the body as it lay at the start of the step, as
    // which contacts see it. That of a slender body is turned back there, by row_frame: momentum across its
    // axis would be a spin about the axis there, with an energy as many times greater as the moment is less.
    Eigen::Matrix3d start_inertia, start_inverse_inertia, inverse_inertia, next_inverse_inertia;
    Quatd row_frame{1, 0, 0, 0};
    PrincipalInertia principal;
    Vec3d momentum{0, 0, 0};             // angular
    Vec3d kept_velocity, kept_momentum;  // as they were at the beginning of the part
    // The part of kept_momentum that comes from the last substep's contact impulses, applied again.
    Vec3d contact_momentum{0, 0, 0};

    void keep() { kept_velocity = velocity, kept_momentum = momentum; }
    void restore() {
      velocity = kept_velocity, momentum = kept_momentum;
      angular_velocity = inverse_inertia * momentum;
    }
  };
  // A joint with an active body, at the current pose. The speed along a row is jacobian_a·(v, ω of a) +
  // jacobian_b·(v, ω of b).
  struct Block {
    std::int32_t a = 0, b = 0;  // indices in bodies_
    bool is_active = false;
    int rigid_rows = 0;  // the first ones; the last one of all is the axis, if the joint has a coordinate
    RowMatrix jacobian_a = RowMatrix::Zero(), jacobian_b = RowMatrix::Zero();
    RowVector response = RowVector::Zero();       // change of each row's speed by a unit impulse along it
    RowVector solved_speeds = RowVector::Zero();  // before the segments of axes changed
    RowVector end_speeds = RowVector::Zero();     // with which solve() ends
    RowVector wanted_speeds = RowVector::Zero();  // that bring the predicted poses onto the joint
    RowVector error = RowVector::Zero();          // of the rigid rows
    // The frame of a and the anchor of b that the part holds together, and what is to be left of their error.
    Quatd held_frame_a{1, 0, 0, 0};
    Vec3d held_anchor_b{0, 0, 0};
    RowVector target_error = RowVector::Zero();
    RowVector impulse = RowVector::Zero();     // in this substep
    RowVector correction = RowVector::Zero();  // of which only moves bodies back onto the joint
    double speed_before = 0.0;    // of the spring's coordinate, before gravity and joints act in the part
    double spring_impulse = 0.0;  // likewise; within solve() that at speed 0
    double spring_at_rest = 0.0;  // of the part, at speed 0
    AxisLaw law;
    int segment = 0;                // in the law
    std::uint8_t kept_held_by = 0;  // of the joint, before the part
    // The axis's compliance when its tree was factored; negative: it had no row.
    double factored_compliance = -1.0;
  };
  // A tree's part in the present stage. Selected trees take part in it, open ones in its present round.
  enum class Role : std::uint8_t { kNone, kSetAside, kSelected, kOpen };
  struct TreeState {
    Role role;
    bool is_active, is_factored, has_changed;
    bool has_axes;               // of hinges or sliders
    bool is_factored_for_blows;  // instead
    bool is_unfinished;
    std::int32_t substep;  // how many have ended
    std::int32_t kept;     // how many count
    bool is_off;           // its corrections are too fast to become velocities
    double residual;       // of the last round
    double time_left_s;    // of the substep
    double h_s;            // of a part

    bool is_selected() const { return role >= Role::kSelected; }
    bool is_open() const { return role == Role::kOpen; }
    void select(bool selects) { role = selects ? Role::kSelected : Role::kNone; }
    void open() {
      if (is_selected()) role = Role::kOpen;
    }
  };
  // kSolveAgain: after contacts have changed the speeds. The rows of a loop that is stretched out are
  // linearly dependent. The curved paths of its bodies leave a second-order error in them that no impulse
  // removes; solving for it would give huge impulses. Trees with loops therefore return to the speeds that
  // solve() found along their rows, and the next substep corrects the error. kFollow: the same without a new
  // prediction.
  enum class Stage { kSolve, kSolveAgain, kFollow, kRelax };
  static bool predicts(Stage stage) { return stage == Stage::kSolve || stage == Stage::kSolveAgain; }

  const Joint* find(scene::JointId) const;
  Joint* find(scene::JointId id) { return const_cast<Joint*>(std::as_const(*this).find(id)); }
  void update_links(BodyStore&);
  void index_bodies(const BodyStore&);
  void begin_body(Body&, const BodyStore&, const SpatialPartition&);
  static Quatd turned_frame(const Body&);
  // The world tensor of the moments about the least, middle and greatest principal axis, or of their
  // inverses.
  static Eigen::Matrix3d tensor_of(const PrincipalInertia&, const Quatd& orientation, const Vec3d& moments);
  void load_velocities(const Rows&, IndexRange trees);
  void store_velocities(const Rows&, IndexRange trees);
  void turn_row_frames(IndexRange trees);
  static RowVector rigid_error(const Joint& j, const Pose& a, const Pose& b) {
    return rigid_error(j, j.frame_a, j.anchor_b, a, b);
  }
  // The same for another frame and anchor.
  static RowVector rigid_error(const Joint&, const Quatd& frame_a, const Vec3d& anchor_b, const Pose& a,
                               const Pose& b);
  // turn: rotation of a hinge since its last known angle, estimated from its speed, rad.
  static double coordinate_of(const Joint&, const Pose& a, const Pose& b, double turn = 0.0);
  // Distance to the nearer limit; negative beyond it.
  static double room_of(const Joint& j) { return std::min(j.coordinate - j.lower, j.upper - j.coordinate); }
  // The sign of the speed with which the coordinate leaves its nearer limit.
  static double way_off_limit(const Joint& j) {
    return j.coordinate - j.lower < j.upper - j.coordinate ? 1.0 : -1.0;
  }
  static Pose pose_of(const BodyStore&, std::int32_t body);
  std::span<const std::int32_t> joints_of(const JointEquations::Tree& t) const {
    return equations_.tree_joints().subspan(t.first_joint, t.joint_count);
  }
  std::span<const std::int32_t> bodies_of(const JointEquations::Tree& t) const {
    return equations_.tree_bodies().subspan(t.first_body, t.body_count);
  }
  std::span<TreeState> states_of(IndexRange trees) {
    return std::span(tree_states_).subspan(trees.begin, trees.end - trees.begin);
  }
  // Calls each(body) for the bodies of the trees.
  template <class Each>
  void for_each_body(IndexRange trees, Each each) {
    for (int t = trees.begin; t < trees.end; ++t)
      for (const std::int32_t i : bodies_of(equations_.trees()[t])) each(bodies_[i]);
  }
  // Calls each(joint, block, h_s) for the joints with an active body, of the selected ones among the trees.
  template <class Each>
  void for_each_selected(IndexRange trees, Each each) {
    for (int t = trees.begin; t < trees.end; ++t) {
      if (!tree_states_[t].is_selected()) continue;
      for (const std::int32_t k : joints_of(equations_.trees()[t]))
        if (blocks_[k].is_active) each(joints_[k], blocks_[k], tree_states_[t].h_s);
    }
  }
  void build_rows(Joint&, Block&, double elapsed_s);
  RowVector speeds(const Block&) const;
  void apply(Block&, const RowVector& impulse);
  void set_law(Joint&, Block&, Stage, double h_s, double spring, double slope);
  void set_law_of_part(Joint&, Block&, double h_s);
  void set_springs_at_start(const BodyStore&, const Rows&, const Substep&, IndexRange trees);
  void set_segment(Block&, int segment);
  bool change_segments(const JointEquations::Tree&, bool all);
  static double axis_compliance(const Block&, double relative);
  bool is_too_long(const JointEquations::Tree&, const TreeState&) const;
  // Finds the impulses with which the selected trees obey their joints at the end of their parts.
  void hold_at_end_of_part(IndexRange trees);
  // Makes the present offset the one that the part holds.
  void hold_as_it_is(Joint&, Block&, double h_s);
  static void correct_target(const Joint&, Block&, double h_s);
  // After the motion: takes back the impulses that only corrected positions.
  void take_back_corrections(IndexRange trees);
  // Removes the speeds across the joints at the present pose.
  void relax_part(IndexRange trees);
  // Trees that are off by no more than `tolerance`, u/s, stay as they are. Returns whether any was off by
  // more.
  bool solve_trees(Stage, IndexRange trees, double tolerance = -1.0);
  void note_springs(IndexRange trees);
  static void add_effort(Joint&, const Block&, const RowVector& impulse);
  static void note_segment(Joint& j, const Block& block) {
    j.held_by = AxisLaw::is_held(block.segment) ? block.law.causes(block.segment) : 0;
  }
  void add_efforts(IndexRange trees, double sign);
  void set_leads(Stage, IndexRange trees);
  double set_residuals(const JointEquations::Tree&, Stage, double h_s, bool has_changed_segments);
  bool is_factored(std::int32_t tree) const;
  enum class Axes : std::uint8_t { kOfSegments, kLocked };  // that are held
  void factor(std::int32_t tree, Axes);
  void solve_blows(std::int32_t tree, std::span<const Blow> blows);
  std::int32_t index_of(std::int32_t body) const {
    return static_cast<std::int32_t>(std::ranges::lower_bound(bodies_, body, {}, &Body::body) -
                                     bodies_.begin());
  }
  void predict(IndexRange trees);
  void move_bodies(const Rows&, IndexRange trees);
  static void store_motion(const Pose& from, const Pose& to, DeltaPose&);

  scene::JointId next_id_ = 0;
  std::vector<Joint> joints_;  // ascending by id
  // ---- derived
  bool indexed_ = false;      // the following have an entry for each body, each joint or each tree
  JointEquations equations_;  // bodies that cannot move are fixed
  std::vector<Body> bodies_;
  std::vector<Pose> path_;  // at the ends of the substeps, each with an entry for every body
  std::vector<Block> blocks_;
  std::vector<TreeState> tree_states_;
  std::vector<Blow> blows_;  // of a stop
  // By tree, and one more at the end: the number of joints that move in the trees before it.
  std::vector<std::int32_t> active_joints_before_;
};

}  // namespace smartsurf::world

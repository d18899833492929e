// Joints of the own engine: constraints between two bodies, or between a body and the table.
//
// A joint has rigid rows, which its kind forbids to move, and at most one axis row, its coordinate
// (scene/JointSpec.h). The rigid rows of a joint are solved together, as a block; what acts along the axis
// (spring, motor, friction, limits) is solved row by row against the inertia that the rigid rows leave.
// Joints are solved one after the other, in the order of creation and back, on one thread.
//
// In each substep solve() finds the impulses, along the constraints at its start, with which they hold at its
// end, on the curved path of the bodies; relax() removes the velocity across the constraints at its end. This
// is RATTLE (H. C. Andersen, 1983): of second order, without drift of the energy. Springs are integrated by
// the trapezoidal rule: their energy neither grows nor decays, at any stiffness. Within a step, bodies with
// joints rotate substep by substep.
#pragma once

#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "common/state/StateArchive.h"
#include "smartsurf/scene/JointSpec.h"
#include "smartsurf/world/body/BodyStore.h"
#include "smartsurf/world/broadphase/SpatialPartition.h"
#include "smartsurf/world/field/JamRelief.h"

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
  // What a and b of the joint are: indices of bodies; −1: the table.
  std::array<std::int32_t, 2> bodies_of(scene::JointId) const;
  scene::JointKind kind_of(scene::JointId id) const { return find(id)->kind; }
  // Removes the joints of a body that was erased from the store; `body` was its index.
  void on_body_removed(std::int32_t body, BodyStore&);
  void archive(common::StateArchive&);

  // ---- within a step; on one thread
  bool empty() const { return joints_.empty(); }
  // Call once the rows have their velocities.
  void begin_step(const BodyStore&, const SpatialPartition&, const Rows&);
  // Applies the impulses of the last substep and solves for the end of this one.
  void solve(const BodyStore&, const Rows&, const Substep&);
  // Call after the rows were moved: rotates the bodies, and removes the velocity that the constraints forbid.
  // Writes the rotations of delta_pose.
  void relax(const Rows&, const Substep&);
  // Appends, after the step, the active bodies of joints that contacts hold off their constraints by
  // `min_depth`, u, or more, with that distance. Allocates while the list grows.
  void find_strained(const BodyStore&, float min_depth, std::vector<DeepContact>&) const;

 private:
  static constexpr int kMaxRows = 6;
  using Vec3d = Eigen::Vector3d;
  using Quatd = Eigen::Quaterniond;
  using RowVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxRows, 1>;
  using RowMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxRows, kMaxRows>;

  struct Joint {
    scene::JointId id;
    scene::JointKind kind;
    bool collide, has_spring, has_motor;
    std::int32_t a, b;         // bodies; b = −1: the table
    Vec3d anchor_a, anchor_b;  // from the centre of mass, body axes; of the table: world frame
    Quatd frame_a, frame_b;    // from the joint's axes, whose z is the axis, to the body's
    double lower, upper;       // ±infinity without limits
    double friction;
    scene::JointSpring spring;
    scene::JointMotor motor;
    // ---- state
    double coordinate;
    double rigid_impulse[kMaxRows];  // of the last substep, like those below
    double spring_impulse, motor_impulse, friction_impulse, lower_impulse, upper_impulse;
    Vec3d force_impulse;    // of the rigid rows on a, over the step
    double effort_impulse;  // along the axis, over the step

    // The sum of what acts along the axis in a substep.
    double axis_impulse() const {
      return spring_impulse + motor_impulse + friction_impulse + lower_impulse - upper_impulse;
    }
  };
  // A body with joints, in double precision. The first one is the table.
  struct Body {
    std::int32_t body = -1, row = -1;
    bool is_active = false, is_sphere = true;
    double inverse_mass = 0.0;
    Vec3d start_position{0, 0, 0}, position{0, 0, 0}, velocity{0, 0, 0}, angular_velocity{0, 0, 0};
    Quatd start_orientation{1, 0, 0, 0}, orientation{1, 0, 0, 0};
    // The rows' angular velocities are those of the momentum with the inertia at the start of the step.
    Eigen::Matrix3d start_inertia, start_inverse_inertia, inverse_inertia;
    PrincipalInertia principal;
    Vec3d momentum{0, 0, 0};                                   // angular
    Vec3d velocity_change{0, 0, 0}, momentum_change{0, 0, 0};  // by the joints, in this stage
  };
  struct Pose {
    Vec3d position;
    Quatd orientation;
  };
  // Velocity along a row: linear·(v_a − v_b) + angular_a·ω_a − angular_b·ω_b.
  struct Row {
    Vec3d linear, angular_a, angular_b;
  };
  // A joint with an active body, at the current pose.
  struct Block {
    std::int32_t joint, a, b;  // indices in joints_ and bodies_
    int row_count;
    Row row[kMaxRows], axis;
    RowVector error, target_error;
    RowMatrix inverse_mass;  // of the rigid rows: its Cholesky factor
    RowVector
        axis_response;  // impulses of the rigid rows that hold them still under a unit impulse along the axis
    double axis_mass;
    double previous_speed;  // of the coordinate at the end of the last substep
  };

  const Joint* find(scene::JointId) const;
  Joint* find(scene::JointId id) { return const_cast<Joint*>(std::as_const(*this).find(id)); }
  void update_links(BodyStore&);
  void index_bodies();
  void load_velocities(const Rows&);
  void store_velocities(const Rows&);
  static Pose predict(const Body&, double h_s);
  static RowVector rigid_error(const Joint&, const Pose& a, const Pose& b);
  static double coordinate_of(const Joint&, const Pose& a, const Pose& b);
  static Pose pose_of(const BodyStore&, std::int32_t body);
  void build_rows(Block&);
  double velocity_along(const Row&, const Block&) const;
  void apply(const Block&, const Row&, double impulse);
  void apply_rigid(const Block&, Joint&, const RowVector& impulse);
  void apply_axis(const Block&, Joint&, double impulse, double& total);
  void warm_start(Block&);
  void solve_rigid(const Block&, const RowVector& velocity);
  void solve_spring(const Block&, double h_s);
  void solve_motor_and_friction(const Block&, double h_s);
  void solve_limits(const Block&, double h_s, bool with_bias);
  double speed_before(const Block&, const BodyStore&, const Rows&, const Substep&) const;
  void rotate_bodies(const Rows&, double h_s);
  template <class Visit>
  void sweep(Visit visit);

  scene::JointId next_id_ = 0;
  std::vector<Joint> joints_;  // ascending by id
  // ---- derived
  bool indexed_ = false;  // bodies_ and blocks_ have an entry for each body and each joint
  std::vector<Body> bodies_;
  std::vector<std::array<std::int32_t, 2>> bodies_of_joint_;  // indices in bodies_
  std::vector<Block> blocks_;                                 // of joints with an active body
};

}  // namespace smartsurf::world

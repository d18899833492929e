// The contact solver: sequential impulses over a few substeps with soft contacts and a relax stage (Soft
// Step, as in Box2D v3; E. Catto, Solver2D, 2024).
//
// Stages: prepare, warm start; per substep integrate velocities, solve with soft constraints, integrate
// positions, relax (solve without bias, so that the push-out adds no velocity); storing of impulses and
// impacts at the end of the step. Joints (JointSolver.h) and contacts with yielding tips (TipSolver.h) are
// solved and relaxed before the contacts. The contact stages end with the support patches (SupportSolver.h)
// and the islands under heavy loads (HeavyIslandSolver.h).
// Impulses carry over from substep to substep and from step to step.
#pragma once

#include <span>
#include <vector>

#include "smartsurf/world/body/BodyStore.h"
#include "smartsurf/world/broadphase/SpatialPartition.h"
#include "smartsurf/world/contact/Contact.h"
#include "smartsurf/world/field/CellForceLimits.h"
#include "smartsurf/world/field/JamRelief.h"
#include "smartsurf/world/field/SupportPatch.h"
#include "smartsurf/world/parallel/Team.h"
#include "smartsurf/world/solver/ConstraintGraph.h"
#include "smartsurf/world/solver/HeavyIslandSolver.h"
#include "smartsurf/world/solver/ImpactSolver.h"
#include "smartsurf/world/solver/JointSolver.h"
#include "smartsurf/world/solver/JointedContacts.h"
#include "smartsurf/world/solver/SharedBatches.h"
#include "smartsurf/world/solver/SkinSolver.h"
#include "smartsurf/world/solver/SupportSolver.h"
#include "smartsurf/world/solver/TipSolver.h"

namespace smartsurf::world {

struct StepSettings {
  float dt_s;
  int substeps;
  Vec3 gravity;                    // u/s²
  SurfaceMaterial field_material;  // of field and ground
  bool operator==(const StepSettings&) const = default;
};

class Solver {
 public:
  explicit Solver(const StepSettings& settings) { set_up(settings); }
  // The calling thread's solver, with these settings. A solver keeps nothing from step to step, so the worlds
  // that a thread steps in turn share its buffers, which stay in the cache.
  static Solver& of_this_thread(const StepSettings&);

  struct Input {
    const SpatialPartition& partition;  // with rows assigned
    ContactList &pair_contacts, &static_contacts;
    const SlabRanges &pair_ranges, &static_ranges;
    std::span<SupportPatches> supports;       // one list per slab
    std::span<CellImpulseLimit> cell_limits;  // one per static contact; empty without force limits
    bool has_wrenches;                        // whether any body has a nonzero wrench
    JointSolver& joints;
    TipSolver& tips;  // after collect(), as the next
    SkinSolver& skin;
    const ImpactSolver::HasRoom& has_room;
    bool has_surface_spin = false;  // of any cell
    bool finds_loads = true;        // of support patches, see finds_loads_when_asked()
    float min_jam_depth = 1e30F;    // of contacts whose bodies jammed_bodies() lists, u
  };
  // Solves one step and writes the impulses to the contact lists. The new velocities and delta poses stay in
  // the solver's rows until store_body(). Called by all members of the team. Allocates while buffers grow.
  void step(BodyStore&, const Input&, const Member&);
  // The bodies of contacts that were deep at the start of the step, as found by each member of the team. A
  // body may occur repeatedly.
  std::span<const std::vector<JammedBody>> jammed_bodies() const { return jammed_bodies_; }
  // The bodies of islands that were solved at once, island by island.
  std::span<const IslandBody> direct_islands() const { return heavy_islands_.bodies(); }
  // The motion of a row's body in the step, and its velocity at the end.
  const DeltaPose& motion(int row) const { return delta_pose_[row]; }
  const BodyVelocity& velocity(int row) const { return velocity_[row]; }
  // Replaces a row's motion by the first part of another.
  void set_motion(int row, const DeltaPose& motion, float fraction) {
    DeltaPose& delta = delta_pose_[row];
    for (int axis = 0; axis < 3; ++axis) {
      delta.translation[axis] = fraction * motion.translation[axis];
      delta.rotation[axis] = fraction * motion.rotation[axis];
    }
  }
  void set_velocity(int row, const Vec3& velocity, const Vec3& angular_velocity) {
    Eigen::Map<Vec3>(velocity_[row].velocity) = velocity;
    Eigen::Map<Vec3>(velocity_[row].angular_velocity) = angular_velocity;
  }
  // See JointSolver::end_motion().
  void end_motion(JointSolver& joints, const BodyStore& bodies) {
    const float h_s = settings_.dt_s / static_cast<float>(settings_.substeps);
    joints.end_motion(bodies, joint_rows(), {h_s, settings_.gravity});
  }
  // Copies velocity and delta pose of a row to its body.
  void store_body(BodyStore&, const SpatialPartition&, int row) const;

 private:
  // Data that the stages of a step share. Each member has its own.
  struct StepContext {
    BodyStore& bodies;
    const Input& input;
    const SpatialPartition& partition;
    IndexRange own_slabs;  // of the member
    IndexRange own_rows;
    SolverBodies solver_bodies;
    SubstepParams pair_params, static_params;
    const ContactKernelTable& kernels;
    bool any_restitution;
    bool all_spheres;
    const BodyVelocity& gravity_change;       // per substep
    std::span<const IndexRange> active_rows;  // of the member's slabs
    std::vector<JammedBody>& jammed_bodies;   // of the member
    std::vector<SupportBatch>& supports;      // of the member's batches

    bool may_impact() const { return any_restitution || !all_spheres; }
    // Without restitution only faces that land flat do.
    bool may_impact(ContactKind kind) const { return any_restitution || !is_sphere_kind(kind); }
    bool has_joint_or_tip_stage() const {
      return !input.joints.empty() || !input.tips.empty() || !input.skin.empty();
    }
    ContactList& contact_list(ContactKind kind) const {
      return is_pair(kind) ? input.pair_contacts : input.static_contacts;
    }
  };
  void set_up(const StepSettings&);
  void resize_buffers(const SpatialPartition&, int member_count, bool has_cell_limits);
  void run_stages(StepContext&, const Member&);
  void prepare_step(StepContext&, const Member&);
  void run_substep(StepContext&, const Member&, int substep);
  void finish_step(StepContext&, const Member&);
  void run_free(StepContext&, const Member&);
  template <class Each>
  void for_each_own_batch(StepContext&, const Member&, Each each);
  void prepare_batch(StepContext&, ContactKind, int batch);
  void prefetch_contacts(StepContext&, ContactKind, int batch) const;
  void set_batch_bodies(StepContext&, ContactBatch&, int index, ContactKind);
  // The contacts of each lane of a batch; none in unused lanes.
  struct BatchContacts {
    const Manifold* manifold[kLanes] = {};
    Contact* first[kLanes] = {};
    int count[kLanes] = {};
    // True if the batch solves a lane's contact k: contacts with what gives way have solvers of their own.
    bool has(int lane, int k) const { return k < count[lane] && !first[lane][k].gives_way(); }
  };
  BatchContacts contacts_of_batch(const StepContext&, ContactKind, int batch) const;
  // What the points of a batch have in common, by lane.
  struct LaneProperties {
    float radius_a[kLanes] = {}, radius_b[kLanes] = {}, friction[kLanes] = {}, rolling_friction[kLanes] = {};
    float position_a[3][kLanes] = {}, position_b[3][kLanes] = {}, relative_velocity[3][kLanes] = {};
    float is_face_patch[kLanes] = {};  // 1: several points touch; of one, the twist is a rounding error
  };
  LaneProperties properties_of_lanes(const StepContext&, ContactKind, ContactBatch&,
                                     const BatchContacts&) const;
  // b: the material of the lane's second body or cell.
  void set_friction(ContactBatch&, LaneProperties&, int lane, const SurfaceMaterial& b) const;
  static void fill_lanes(ContactKind, ContactBatch&, const LaneProperties&, int lane,
                         const Contact* const* four, BatchPoint&, BatchPointDetail&);
  void fill_points(const StepContext&, ContactKind, ContactBatch&, const BatchContacts&);
  void fill_impulse_limits(const StepContext&, ContactBatch&, int index, const ContactList&);
  void find_impact_candidates(StepContext&, ContactKind, int batch, const Member&);
  void solve_impacts(StepContext&, const Member&);
  void store_impulses(StepContext&, ContactKind, int batch);
  std::span<const IndexRange> find_active_rows(const SpatialPartition&, IndexRange slabs, int member);
  void load_bodies(StepContext&);
  BodyVelocity external_velocity_change(const StepContext&, int row) const;
  void integrate_velocities(StepContext&, bool first);
  void update_spinning_surface_velocities(StepContext&, const Member&, float time_s);
  void integrate_positions(StepContext&);
  enum class SupportStage { kWarmStart, kSolve, kRelax };
  void run_contact_stage(StepContext&, const Member&, const ContactKernel (&)[kContactKindCount],
                         float elapsed_s, SupportStage);
  void run_supports(StepContext&, const Member&, SupportStage);
  void collect_supports(StepContext&, const Member&);
  template <class Each>
  static void for_each_own_support(const StepContext&, Each each);
  template <class OnJoints, class OnPoints>
  void run_joint_and_tip_stage(const StepContext&, const Member&, OnJoints, OnPoints);
  PointStep point_step(const StepContext&);
  JointSolver::Rows joint_rows() { return {velocity_.data(), start_velocity_.data(), delta_pose_.data()}; }
  void settle_jointed_contacts(StepContext&, const Member&, bool is_soft);
  void prepare_supports(StepContext&);
  void store_supports(StepContext&);

  BatchPoints batch_points() { return {point_.data(), detail_.data(), limit_.data()}; }
  SolverBodies solver_bodies() { return {velocity_.data(), delta_pose_.data(), inverse_inertia_.data()}; }

  StepSettings settings_;
  // ---- derived from the settings
  float h_s_;
  SubstepParams pair_params_, static_params_;
  BodyVelocity gravity_change_;  // per substep
  ConstraintGraph graph_;
  SharedBatches shared_batches_;        // of several members
  BatchRangesByColour serial_batches_;  // of a single member
  ImpactSolver impacts_;
  HeavyIslandSolver heavy_islands_;
  JointedContacts jointed_contacts_;
  std::vector<BatchPoint> point_;
  std::vector<BatchPointDetail> detail_;
  std::vector<BatchPointLimit> limit_;  // empty without force limits
  // Indexed by row of the partition, so that bodies close in space are close in memory.
  std::vector<BodyVelocity> velocity_;
  std::vector<DeltaPose> delta_pose_;
  std::vector<InverseInertia> inverse_inertia_;
  std::vector<SurfaceMaterial> material_;
  // The support patch of a row's body; only set if there are any.
  struct SupportReference {
    std::int32_t slab = -1, patch = 0;  // slab < 0: none
  };
  std::vector<SupportReference> support_of_row_;
  bool has_supports_ = false;                           // in this step
  std::vector<std::vector<SupportBatch>> supports_;     // by member, of its batches
  std::vector<std::vector<JammedBody>> jammed_bodies_;  // one list per member
  std::vector<std::vector<IndexRange>> active_rows_;    // likewise
  std::vector<BodyVelocity> start_velocity_;  // after external forces, before the contacts of the substep
};

}  // namespace smartsurf::world

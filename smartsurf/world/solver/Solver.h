// Solves the contacts of one step and finds how the bodies move by it: sequential impulses over a few short
// substeps.
//
// In each substep every contact is solved once towards the gap that it will have at the substep's end,
// overlaps being pushed apart softly, then the bodies move, then every contact is relaxed once, so that the
// push leaves no speed behind. Impulses carry over from substep to substep and from step to step. The rebound
// comes last.
#pragma once

#include <vector>

#include "smartsurf/world/BodyStore.h"
#include "smartsurf/world/Contact.h"
#include "smartsurf/world/parallel/SharedBatches.h"
#include "smartsurf/world/parallel/SpatialPartition.h"
#include "smartsurf/world/parallel/Team.h"
#include "smartsurf/world/solver/ConstraintGraph.h"

namespace smartsurf::world {

struct StepSettings {
  float dt_s;
  int substeps;
  Vec3 gravity;                                                               // u/s²
  float field_friction_root, field_rolling_friction_root, field_restitution;  // of the surface and the ground
};

class Solver {
 public:
  explicit Solver(const StepSettings& settings)
      : settings_(settings),
        field_material_{0.0F, settings.field_friction_root, settings.field_rolling_friction_root,
                        settings.field_restitution} {}

  struct Input {
    const SpatialPartition& partition;  // with their rows listed
    ContactList &pair_contacts, &static_contacts;
    const SlabRanges &pair_ranges, &static_ranges;
    bool has_force_limits;  // whether any contact has a limit
    bool has_wrenches;      // whether any body has a wrench
  };
  // One step. The lists come back with the impulses of the last substep and the sums of the step; how each
  // body moves stays in its row. All members of the team together.
  void step(BodyStore&, const Input&, const Member&);
  // Hands the body of a row its motion.
  void store_body(BodyStore&, const SpatialPartition&, int row) const;

 private:
  struct StepContext;
  void resize_buffers(const SpatialPartition&, int member_count);
  void run_stages(StepContext&, const Member&);
  void prepare_batch(StepContext&, ContactKind, int batch);
  void set_batch_bodies(StepContext&, ContactBatch&, int index, ContactKind);
  void clear_points(const ContactBatch&);
  void clear_details(const ContactBatch&, bool all);
  // What of each point is filled in.
  struct FillMask {
    bool points, surface, details;
  };
  void fill_lane(const StepContext&, ContactBatch&, int lane, const Manifold&, const std::vector<Contact>&,
                 const FillMask&);
  void fill_impulse_limits(ContactBatch&, int index, const ContactList&);
  void store_impulses(StepContext&, ContactKind, int batch);
  template <class Each>
  void for_each_active_row(const StepContext&, Each each) const;
  void load_bodies(StepContext&);
  BodyVelocity external_velocity_change(const StepContext&, int row) const;
  void integrate_velocities(StepContext&, bool first);
  void integrate_positions(StepContext&);
  void run_contact_stage(StepContext&, const Member&, const ContactKernel (&)[kContactKindCount],
                         float elapsed_s);

  BatchPoints batch_points() { return {point_.data(), detail_.data()}; }
  SolverBodies solver_bodies() { return {velocity_.data(), delta_pose_.data(), inverse_inertia_.data()}; }

  StepSettings settings_;
  SurfaceMaterial field_material_;
  ConstraintGraph graph_;
  SharedBatches shared_batches_;
  std::vector<BatchPoint> point_;
  std::vector<BatchPointDetail> detail_;
  // One a row of the slabs: what the passes read lies near what they read next.
  std::vector<BodyVelocity> velocity_;
  std::vector<DeltaPose> delta_pose_;
  std::vector<InverseInertia> inverse_inertia_;
  std::vector<SurfaceMaterial> material_;
  std::vector<BodyVelocity> start_velocity_;  // before the contacts of the substep
};

}  // namespace smartsurf::world

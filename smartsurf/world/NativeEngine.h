// The native engine.
//
// Cells are not bodies: the field is an array, and contacts with it are found by grid arithmetic and in
// closed form, so the cost grows with the number of contacts and not with the number of cells. Results are
// bit-identical for any number of threads. NativeEngine.cpp has the interface, NativeEngineStep.cpp the time
// step.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/world/CollisionPipeline.h"
#include "smartsurf/world/Engine.h"
#include "smartsurf/world/LengthUnit.h"
#include "smartsurf/world/Sleep.h"
#include "smartsurf/world/StateHash.h"
#include "smartsurf/world/StepCountdown.h"
#include "smartsurf/world/body/BodyStore.h"
#include "smartsurf/world/field/CellForceLimits.h"
#include "smartsurf/world/field/JamRelief.h"
#include "smartsurf/world/narrowphase/SeamCorrection.h"
#include "smartsurf/world/solver/SkinSolver.h"
#include "smartsurf/world/solver/Solver.h"

namespace smartsurf::world {

class NativeEngine final : public Engine {
 public:
  // Adds the scene's objects with ids 0, 1, …, and its joints likewise. `field` and `pool` must outlive the
  // engine. Without a pool everything runs on the caller.
  NativeEngine(const scene::SceneSpec&, surface::Field& field, common::ThreadPool* pool = nullptr);

  std::string name() const override { return "native"; }
  // The number after "physics" is raised whenever equal inputs give other bits.
  std::string version() const override { return SMARTSURF_VERSION "+physics39"; }
  scene::ObjectId add(const scene::ObjectSpec&) override;
  bool alive(scene::ObjectId id) const override { return bodies_.find(id) >= 0; }
  bool remove(scene::ObjectId) override;
  bool set_state(scene::ObjectId, const scene::ObjectStateUpdate&) override;
  bool apply_force(scene::ObjectId, const Eigen::Vector3d& force, const std::optional<Eigen::Vector3d>& point,
                   double duration_s) override;
  scene::ObjectState state(scene::ObjectId) const override;
  scene::JointId add_joint(const scene::JointSpec&) override;
  bool has_joint(scene::JointId id) const override { return joints_.contains(id); }
  void remove_joint(scene::JointId) override;
  void set_motor(scene::JointId, const scene::JointMotor&) override;
  void set_spring(scene::JointId, const scene::JointSpring&) override;
  scene::JointState joint_state(scene::JointId) const override;
  surface::BodyView bodies() const override;
  std::span<surface::Wrench> wrenches() override;
  void step() override;
  void write_impulses_when_asked() override { writes_when_asked_ = true; }
  void write_impulses() override;
  std::vector<ContactPoint> contacts() const override;
  // Work of the last step, which grows only with what moves and what touches it.
  struct StepWork {
    std::size_t active = 0;    // bodies that moved
    std::size_t in_grid = 0;   // bodies in the broad phase: those, and static ones
    std::size_t rows = 0;      // bodies that the solver read: those, and the sleepers that they touch
    std::size_t pairs = 0;     // pairs of bodies that the narrow phase tested
    std::size_t contacts = 0;  // points in contact lists
  };
  StepWork step_work() const;
  // Passes over islands of sleepers to find their loads at rest, in bodies, since the start.
  std::size_t rest_load_work() const { return sleep_.rest_loads().work(); }
  int sleeping_count() const override { return sleep_.sleeping_count(); }
  void snapshot(scene::Snapshot&, bool with_hash) const override;
  bool is_overloaded() const override { return collision_.is_overloaded(); }
  void archive(common::StateArchive&, std::span<const scene::ObjectSpec> catalogue,
               std::size_t declared) override;
  std::optional<scene::ObjectId> first_non_finite() const override;

 private:
  static constexpr std::size_t kMinParallelBodies = 512;  // fewer are not worth the barriers

  void wake_joint(scene::JointId);
  void wake_with_neighbours(std::int32_t body);
  // Calls each(patch, samples, sample) for the loaded samples of the support patches of bodies that are
  // awake.
  template <class Each>
  void for_each_awake_support(Each each) const;

  // ---- the stages of a step, in NativeEngineStep.cpp
  struct Stage;
  template <std::size_t first, std::size_t end>
  void run_stages(const Member&);
  void read_field();
  void hold_jammed_cells();
  void apply_forces();
  void predict_skin();
  void wake_disturbed();
  void wake_hit_sleepers();
  void restore_contacts();
  void collect_active_bodies();
  void clear_contacts();
  void update_broadphase(const Member&);
  void find_contacts(const Member&);
  void correct_seams(const Member&);
  void share_force_limits();
  void collect_tip_contacts();
  void collect_skin_contacts();
  void solve(const Member&);
  void stop_at_bodies(const Member&);
  void stop_jointed();
  void finalize_bodies(const Member&);
  void store_tips_and_skin();
  void yield_overloaded_cells();
  void relieve_jams();
  void keep_strained_awake();
  void put_to_sleep();
  void advance_skin();
  void write_cell_impulses();
  void write_tip_impulses();
  void write_skin_impulses();
  void return_lowered_speeds();
  void clear_forces();

  surface::Skin::Location location_on_skin(const Manifold&, const Contact&) const;
  void record_cell_impulses(IndexRange manifolds);
  void find_loads() const;
  void update_sleeper_impulses();

  // Everything below is in world units, except where a name says so.
  LengthUnit unit_;
  std::vector<scene::Material> scene_materials_;
  surface::Field& scene_field_;
  std::vector<scene::Material> materials_;
  surface::Field field_copy_;  // empty while both units are the same
  surface::Field& field_;
  StepSettings settings_;
  common::ThreadPool* pool_;
  mutable Team team_;
  BodyStore bodies_;
  scene::ObjectId next_id_ = 0;
  struct TimedForce {
    scene::ObjectId id;
    Vec3 force, local_point;  // local_point: where it acts, from the centre of mass, body axes, u
    StepCountdown time_left;
  };
  std::vector<TimedForce> timed_forces_;
  std::vector<std::int32_t> active_bodies_;
  std::optional<unsigned> active_version_;  // Sleep::set_version() that active_bodies_ is for
  ContactList pair_contacts_, static_contacts_;
  Sleep sleep_;
  mutable CollisionPipeline collision_;  // for find_loads()
  SeamCorrection seams_;
  Solver* solver_ = nullptr;  // of the thread that steps, during the step
  JointSolver joints_;
  TipSolver tips_;
  SkinSolver elastic_skin_;
  CellForceLimits force_limits_;
  JamRelief jam_relief_;
  std::vector<JammedBody> jammed_bodies_, strained_bodies_;
  bool lowered_speeds_ = false;  // in this step
  bool has_wrenches_ = false;    // since the last step
  struct Load {
    std::int32_t cell;  // −1: not a field contact, or no impulse
    float impulse;
  };
  std::vector<Load> cell_impulses_;  // one per static contact
  bool writes_when_asked_ = false;
  // True if the loads of support patches have yet to be found since the last step, and Field::impulse
  // written.
  mutable bool lacks_loads_ = false;
  bool lacks_impulses_ = false;
  // Cells on which active bodies had an impulse in the last step, and on which sleepers have one; impulse of
  // the sleepers on each cell, in scene units.
  std::vector<std::int32_t> loaded_cells_, sleeper_cells_;
  std::vector<float> sleeper_impulse_;
  // The contacts with a skin in this step, and where they are.
  struct SkinPoint {
    std::int32_t contact, body;
    surface::Skin::Location at;
  };
  std::vector<SkinPoint> skin_points_;
  std::vector<std::int32_t> loaded_tips_;  // with an impulse in the last step
  unsigned sleeper_impulse_version_ = 0;   // Sleep::contacts_version() that sleeper_impulse_ is for
  // Bodies whose motion in this step ends where they would enter another one, ascending, and after which
  // fraction.
  struct Stop {
    std::int32_t body;
    float fraction;
    DeltaPose motion;  // in the whole step; unused where joints hold the body
    bool slows = false;
    Vec3 velocity{0, 0, 0}, angular_velocity{0, 0, 0};  // afterwards, if it slows
  };
  std::array<Stop, 2> slow_down(std::array<std::int32_t, 2> pair, float fraction) const;
  std::vector<Stop> stops_;
  std::vector<std::vector<Stop>> stops_of_members_;
  std::vector<std::int32_t> hit_sleepers_;
  mutable FieldHasher field_hasher_;
  bool field_moved_ = false;  // in the last step: at its end cells may stand elsewhere, or be about to stop
  mutable bool field_changed_ = true;  // heights or speeds, since they were hashed
  // Storage behind bodies(), in scene units.
  mutable std::vector<Vec3> scene_position_, scene_velocity_, angular_velocity_;
  mutable std::vector<Quat> orientation_;
};

template <class Each>
void NativeEngine::for_each_awake_support(Each each) const {
  for (const SupportPatches& list : collision_.supports())
    for (const SupportPatch& p : list.patches)
      for (Index i = p.first; !bodies_.asleep[p.body] && i < p.first + p.count + p.outlier_count; ++i)
        if (list.samples.load[i] > 0.0F) each(p, list.samples, i);
}

}  // namespace smartsurf::world

// The state of the own engine, shared by its interface (NativeEngine.cpp) and its time step (NativeEngineStep.cpp).
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/world/BodyStore.h"
#include "smartsurf/world/CollisionPipeline.h"
#include "smartsurf/world/LengthUnit.h"
#include "smartsurf/world/NativeEngine.h"
#include "smartsurf/world/Sleep.h"
#include "smartsurf/world/StateHash.h"
#include "smartsurf/world/field/CellForceLimits.h"
#include "smartsurf/world/field/JamRelief.h"
#include "smartsurf/world/solver/SkinSolver.h"
#include "smartsurf/world/solver/Solver.h"

namespace smartsurf::world {

inline constexpr std::size_t kMinParallelBodies = 512;  // fewer bodies are not worth the barriers

struct TimedForce {
  scene::ObjectId id;
  Vec3 force, local_point;  // local_point: where it acts, from the centre of mass, body axes, u
  long steps_left;
};

struct NativeEngine::Impl {
  Impl(const scene::SceneSpec&, surface::Field& cells, common::ThreadPool* pool);

  // One time step, see Engine::step().
  void step();
  void wake_joint(scene::JointId);
  void read_inputs();
  void apply_timed_forces();
  void collect_active_bodies();
  void wake_disturbed();
  void wake_hit_sleepers();
  void find_sleepers_near_fast_bodies();
  void find_fast_bodies_near_sleepers();
  void step_active_bodies(const Member&);
  void finalize_bodies(const Member&);
  void record_cell_impulses(IndexRange manifolds);
  void write_cell_impulses();
  void write_tip_impulses();
  void locate_skin_contacts();
  void write_skin_impulses();

  // Everything below is in world units, except where a name says so.
  LengthUnit unit;
  std::vector<scene::Material> scene_materials;
  surface::Field& scene_field;
  std::vector<scene::Material> materials;
  surface::Field field_copy;  // empty while both units are the same
  surface::Field& field;
  StepSettings settings;
  Team team;
  BodyStore bodies;
  scene::ObjectId next_id = 0;
  std::vector<TimedForce> timed_forces;
  std::vector<std::int32_t> active_bodies;
  ContactList pair_contacts, static_contacts;
  Sleep sleep;
  CollisionPipeline collision;
  Solver* solver = nullptr;  // of the thread that steps, during the step
  JointSolver joints;
  TipSolver tips;
  SkinSolver elastic_skin;
  CellForceLimits force_limits;
  JamRelief jam_relief;
  std::vector<DeepContact> deep_bodies, strained_bodies;  // of this step
  bool lowered_speeds = false;                            // in this step
  bool overloaded = false;                                // see Engine::is_overloaded()
  bool has_wrenches = false;                              // since the last step
  struct Load {
    std::int32_t cell;  // −1: not a field contact, or no impulse
    float impulse;
  };
  std::vector<Load> cell_impulses;  // one per static contact
  // Cells on which active bodies had an impulse in the last step, and on which sleepers have one; impulse of the
  // sleepers on each cell, in scene units.
  std::vector<std::int32_t> loaded_cells, sleeper_cells;
  std::vector<float> sleeper_impulse;
  // The contacts with a skin in this step, and where they are.
  struct SkinPoint {
    std::int32_t contact, body;
    surface::Skin::Location at;
  };
  std::vector<SkinPoint> skin_points;
  std::vector<std::int32_t> loaded_tips;  // with an impulse in the last step
  unsigned sleeper_impulse_version = 0;   // Sleep::change_count() that sleeper_impulse is for
  std::vector<std::int32_t> hit_sleepers;
  common::ThreadPool* pool;
  FieldHasher field_hasher;
  bool field_moved = false;   // in the last step: at its end cells may stand elsewhere, or be about to stop
  bool field_changed = true;  // heights or speeds, since they were hashed
  // Storage behind bodies(), in scene units. Positions only where they are not those in the store.
  mutable std::vector<Vec3> scene_position, scene_velocity, angular_velocity;
};

}  // namespace smartsurf::world

// Bullet as the reference engine: rigid bodies, collision detection and solver of Bullet in double precision.
//
// A step is several substeps of Bullet with many iterations. Cells near bodies are kinematic boxes
// (CellPool.h). Runs on the caller's thread. docs/engines.md says what it models otherwise than the native
// engine.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "common/threads/ThreadPool.h"
#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/world/Engine.h"
#include "smartsurf/world/LengthUnit.h"
#include "smartsurf/world/StateHash.h"
#include "smartsurf/world/StepCountdown.h"

namespace smartsurf::world {

class BulletJoint;

class BulletEngine final : public Engine {
 public:
  // Adds the scene's objects and joints. `field` and `pool` must outlive the engine.
  BulletEngine(const scene::SceneSpec&, surface::Field& field, common::ThreadPool* pool);
  ~BulletEngine() override;

  std::string name() const override { return "bullet"; }
  std::string version() const override;
  scene::ObjectId add(const scene::ObjectSpec&) override;
  bool alive(scene::ObjectId) const override;
  bool remove(scene::ObjectId) override;
  bool set_state(scene::ObjectId, const scene::ObjectStateUpdate&) override;
  bool apply_force(scene::ObjectId, const Eigen::Vector3d& force, const std::optional<Eigen::Vector3d>& point,
                   double duration_s) override;
  scene::ObjectState state(scene::ObjectId) const override;
  scene::JointId add_joint(const scene::JointSpec&) override;
  bool has_joint(scene::JointId) const override;
  void remove_joint(scene::JointId) override;
  void set_motor(scene::JointId, const scene::JointMotor&) override;
  void set_spring(scene::JointId, const scene::JointSpring&) override;
  scene::JointState joint_state(scene::JointId) const override;
  surface::BodyView bodies() const override;
  std::span<surface::Wrench> wrenches() override { return wrenches_; }
  void step() override;
  std::vector<ContactPoint> contacts() const override { return contacts_; }
  int sleeping_count() const override { return 0; }  // nothing sleeps
  void snapshot(scene::Snapshot&, bool with_hash) const override;
  // Bullet has no interface to the state of its solver and its contact caches.
  [[noreturn]] void archive(common::StateArchive&, std::span<const scene::ObjectSpec>, std::size_t) override {
    throw common::UserError("the engine 'bullet' cannot be saved: use engine = 'native'");
  }
  std::optional<scene::ObjectId> first_non_finite() const override;

 private:
  struct Impl;
  // Index of the object, or −1.
  int find(scene::ObjectId) const;
  BulletJoint* find_joint(scene::JointId) const;  // null: none
  void read_body(std::size_t index);
  void apply_timed_forces();

  LengthUnit unit_;
  std::vector<scene::Material> materials_;  // in scene units
  surface::Field& scene_field_;
  surface::Field field_copy_;  // empty while both units are the same
  surface::Field& field_;      // in world units
  double dt_s_;
  scene::ObjectId next_id_ = 0;
  scene::JointId next_joint_id_ = 0;
  struct TimedForce {
    scene::ObjectId id;
    Eigen::Vector3d force, local_point;  // in world units; local_point: from the centre of mass, body axes
    StepCountdown time_left;
  };
  std::vector<TimedForce> timed_forces_;
  // One entry per live object, ascending by id; in scene units.
  std::vector<scene::ObjectId> ids_;
  std::vector<Eigen::Vector3f> positions_, velocities_, angular_velocities_;
  std::vector<Eigen::Quaternionf> orientations_;
  // Poses of bodies().
  mutable std::vector<Eigen::Vector3f> led_positions_;
  mutable std::vector<Eigen::Quaternionf> led_orientations_;
  std::vector<float> masses_;
  std::vector<surface::Wrench> wrenches_;
  std::vector<ContactPoint> contacts_;  // of all substeps, in scene units
  std::size_t contact_count_ = 0;       // in the last substep
  mutable FieldHasher field_hasher_;
  std::unique_ptr<Impl> impl_;
};

}  // namespace smartsurf::world

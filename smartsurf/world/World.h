// The physics of one experiment: an engine with the scene's objects in it.
#pragma once

#include <memory>

#include "common/threads/ThreadPool.h"
#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/world/Engine.h"

namespace smartsurf::world {

class World {
 public:
  // Adds the objects of the scene with ids 0, 1, …, and its joints likewise. The engine's field must outlive the world.
  World(const scene::SceneSpec&, std::unique_ptr<Engine>);
  // The same with the own engine, whatever the scene's `engine`. `pool` must outlive the world; without it,
  // everything runs on the caller.
  World(const scene::SceneSpec&, surface::Field&, common::ThreadPool* pool = nullptr);

  // As Engine's.
  const Engine& engine() const { return *engine_; }
  scene::ObjectId add(const scene::ObjectSpec& spec) { return engine_->add(spec); }
  bool alive(scene::ObjectId id) const { return engine_->alive(id); }
  bool remove(scene::ObjectId id) { return engine_->remove(id); }
  bool place(scene::ObjectId id, const scene::ObjectStateUpdate& update) {
    return engine_->place(id, update);
  }
  bool apply_force(scene::ObjectId id, const Eigen::Vector3d& force,
                   const std::optional<Eigen::Vector3d>& point, double duration_s) {
    return engine_->apply_force(id, force, point, duration_s);
  }
  scene::ObjectState state(scene::ObjectId id) const { return engine_->state(id); }
  scene::JointId add_joint(const scene::JointSpec& spec) { return engine_->add_joint(spec); }
  bool has_joint(scene::JointId id) const { return engine_->has_joint(id); }
  void remove_joint(scene::JointId id) { engine_->remove_joint(id); }
  void set_motor(scene::JointId id, const scene::JointMotor& motor) { engine_->set_motor(id, motor); }
  void set_spring(scene::JointId id, const scene::JointSpring& spring) { engine_->set_spring(id, spring); }
  scene::JointState joint_state(scene::JointId id) const { return engine_->joint_state(id); }
  surface::BodyView bodies() const { return engine_->bodies(); }
  std::span<surface::Wrench> wrenches() { return engine_->wrenches(); }
  void step() { engine_->step(); }
  std::vector<ContactPoint> contacts() const { return engine_->contacts(); }
  int sleeping_count() const { return engine_->sleeping_count(); }
  void snapshot(scene::Snapshot& out) const { engine_->snapshot(out); }
  bool is_overloaded() const { return engine_->is_overloaded(); }
  void archive(common::StateArchive& a, std::span<const scene::ObjectSpec> catalogue, std::size_t declared) {
    engine_->archive(a, catalogue, declared);
  }
  std::optional<scene::ObjectId> first_non_finite() const { return engine_->first_non_finite(); }

 private:
  std::unique_ptr<Engine> engine_;
};

}  // namespace smartsurf::world

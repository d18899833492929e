// The own engine.
//
// Cells are not bodies: the field is an array, and contacts with it are found by grid arithmetic and in closed
// form, so the cost grows with the number of contacts and not with the number of cells. Results are
// bit-identical for any number of threads.
#pragma once

#include <memory>

#include "smartsurf/world/World.h"

namespace smartsurf::world {

class NativeEngine final : public Engine {
 public:
  // Without objects. `field` and `pool` must outlive the engine. Without a pool everything runs on the caller.
  NativeEngine(const scene::SceneSpec&, surface::Field& field, common::ThreadPool* pool);
  ~NativeEngine() override;

  std::string name() const override { return "native"; }
  // The number after "physics" is raised whenever equal inputs give other bits.
  std::string version() const override { return SMARTSURF_VERSION "+physics6"; }
  scene::ObjectId add(const scene::ObjectSpec&) override;
  bool alive(scene::ObjectId) const override;
  bool remove(scene::ObjectId) override;
  bool place(scene::ObjectId, const scene::ObjectStateUpdate&) override;
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
  std::span<surface::Wrench> wrenches() override;
  void step() override;
  std::vector<ContactPoint> contacts() const override;
  int sleeping_count() const override;
  void snapshot(scene::Snapshot&) const override;
  bool is_overloaded() const override;
  void archive(common::StateArchive&, std::span<const scene::ObjectSpec> catalogue,
               std::size_t declared) override;
  std::optional<scene::ObjectId> first_non_finite() const override;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace smartsurf::world

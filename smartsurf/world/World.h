// The physics: rigid objects on the field of cells, stepped in fixed steps.
//
// The cells are not bodies: the field is an array, whose contacts are found by grid arithmetic and closed
// forms, so cost follows the contacts and not the cells. The same inputs give the same bits, whatever the
// number of threads.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/threads/ThreadPool.h"
#include "smartsurf/scene/ObjectState.h"
#include "smartsurf/scene/Snapshot.h"
#include "smartsurf/surface/Field.h"
#include "smartsurf/surface/actuators/BodyForces.h"

namespace smartsurf::world {

// The name and version of what computes the physics, for recordings.
std::string physics_version();

// A point where bodies touched in the last step.
struct ContactPoint {
  Eigen::Vector3f point, normal;  // world frame
  float impulse;                  // along the normal over the step, mass·u/s
};

class World {
 public:
  // `field` and `pool` must outlive the world. step() reads what the cells do and writes Field::impulse.
  // The objects of the scene get the ids 0, 1, …. Without a pool everything runs on the caller.
  World(const scene::SceneSpec&, surface::Field& field, common::ThreadPool* pool = nullptr);
  ~World();
  World(const World&) = delete;
  World& operator=(const World&) = delete;

  // Adds an object and returns its id: the next number, never used before.
  scene::ObjectId add(const scene::ObjectSpec&);

  // False (and nothing happens) when no such object is alive.
  bool alive(scene::ObjectId) const;
  bool remove(scene::ObjectId);
  // Changes what has a value, keeps the rest.
  bool place(scene::ObjectId, const scene::ObjectStateUpdate&);
  // A constant force (mass·u/s²) through the next `duration_s` of simulated time, at least one step; at
  // `point` (world frame, fixed to the body from now on) or at the centre of mass.
  bool apply_force(scene::ObjectId, const Eigen::Vector3d& force, const std::optional<Eigen::Vector3d>& point,
                   double duration_s);
  // The object must be alive.
  scene::ObjectState state(scene::ObjectId) const;

  // The objects as actuators see them; valid until the next step, or change of the objects.
  surface::BodyView bodies() const;
  // What acts on each body during the next step, in the order of bodies(); zero again after it. A wrench that
  // is not zero wakes its body.
  std::span<surface::Wrench> wrenches();

  // One fixed physics step against the field as planned (Field::speed); the caller commits the field after
  // it.
  void step();

  // The contacts of the last step that bore any load. Allocates.
  std::vector<ContactPoint> contacts() const;
  // How many bodies are asleep: at rest on cells that do not move, and not computed.
  int sleeping_count() const;

  // Copies poses, velocities, heights and counters; keeps the vectors' memory. tick and time are the
  // caller's.
  void snapshot(scene::Snapshot&) const;

  // The first object whose state is not finite, if any.
  std::optional<scene::ObjectId> first_non_finite() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace smartsurf::world

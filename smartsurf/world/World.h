// The physics: simulates rigid objects on the field of cells in fixed time steps.
//
// Cells are not bodies: the field is an array, and contacts with it are found by grid arithmetic and in closed
// form, so the cost grows with the number of contacts and not with the number of cells. Results are
// bit-identical for any number of threads. The object itself is not thread-safe.
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

// Name and version of the physics engine, for recordings.
std::string physics_version();

// A contact point of the last step.
struct ContactPoint {
  Eigen::Vector3f point, normal;  // world frame
  float impulse;                  // along the normal over the step, mass·u/s
};

class World {
 public:
  // Adds the objects of the scene with ids 0, 1, …. `field` and `pool` must outlive the world. Without a pool
  // everything runs on the caller.
  World(const scene::SceneSpec&, surface::Field& field, common::ThreadPool* pool = nullptr);
  ~World();
  World(const World&) = delete;
  World& operator=(const World&) = delete;

  // Adds an object and returns its id. Ids ascend and are never reused.
  scene::ObjectId add(const scene::ObjectSpec&);

  // These return false and do nothing if the object is not alive.
  bool alive(scene::ObjectId) const;
  bool remove(scene::ObjectId);
  // Sets the values that are present and keeps the others. Wakes the object and its neighbours.
  bool place(scene::ObjectId, const scene::ObjectStateUpdate&);
  // Applies a constant force (world frame, mass·u/s²) during the next `duration_s` of simulated time, for at
  // least one step. It acts at `point`, given in the world frame and fixed to the body from then on, or at the
  // centre of mass.
  bool apply_force(scene::ObjectId, const Eigen::Vector3d& force, const std::optional<Eigen::Vector3d>& point,
                   double duration_s);
  // The object must be alive.
  scene::ObjectState state(scene::ObjectId) const;

  // The live objects, for actuators. Valid until the next step or until objects are added, removed or placed.
  surface::BodyView bodies() const;
  // External force and torque on each body during the next step, in the order of bodies(); reset to zero after
  // it. A nonzero wrench wakes its body.
  std::span<surface::Wrench> wrenches();

  // Advances the world by one time step. Reads the field's heights and planned velocities; writes Field::impulse
  // and lowers Field::speed of cells that yield under their force limit. The caller commits the field afterwards.
  void step();

  // The contacts with a positive normal impulse, those of sleeping bodies included. Allocates.
  std::vector<ContactPoint> contacts() const;
  // Number of sleeping bodies: at rest on cells that do not move, hence not simulated.
  int sleeping_count() const;

  // Copies object states, field heights, the contact count and the state hash; reuses the vectors' memory.
  // Leaves tick and time to the caller.
  void snapshot(scene::Snapshot&) const;

  // The first object whose state is not finite, if any.
  std::optional<scene::ObjectId> first_non_finite() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace smartsurf::world

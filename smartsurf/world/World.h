// The physics: rigid objects on the field of pins, stepped by Bullet in fixed steps.
//
// The pins are not bodies: the whole field is one collision object, whose contacts are found by grid arithmetic and
// closed forms (FieldContacts.h), so cost follows the contacts and not the pins. Single-threaded; the same inputs
// give the same bits. One World may live in each thread.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "smartsurf/scene/ObjectState.h"
#include "smartsurf/scene/Snapshot.h"
#include "smartsurf/surface/BodyForces.h"
#include "smartsurf/surface/Field.h"

namespace smartsurf::world {

// The physics library's version, for recordings: "3.24".
std::string physics_version();

class World {
 public:
  // `field` must outlive the world; it is read, and its impulses are written, during step() only. The objects of the scene get the ids 0, 1, ….
  World(const scene::SceneSpec&, surface::Field& field);
  ~World();
  World(const World&) = delete;
  World& operator=(const World&) = delete;

  // Adds an object and returns its id: the next number, never used before.
  scene::ObjectId add(const scene::ObjectSpec&);

  // False (and nothing happens) when no such object is alive.
  bool alive(scene::ObjectId) const;
  bool remove(scene::ObjectId);
  // Changes what has a value, keeps the rest.
  bool place(scene::ObjectId, const scene::Placement&);
  // A constant force (mass·u/s²) through the next `duration_s` of simulated time, at least one step; at `point`
  // (world frame, fixed to the body from now on) or at the centre of mass.
  bool push(scene::ObjectId, const Eigen::Vector3d& force, const std::optional<Eigen::Vector3d>& point,
            double duration_s);
  // The object must be alive.
  scene::ObjectState state(scene::ObjectId) const;

  // One fixed physics step against the field as planned (ActuatorArray::plan); the caller commits the field after it.
  void step();

  // The objects as actuators see them; valid until the next step, or change of the objects.
  surface::Bodies bodies() const;
  // One entry a body of bodies(), for actuators to add to; the next step applies them and sets them to zero.
  std::span<surface::Wrench> wrenches();

  // Copies poses, velocities, heights and counters; keeps the vectors' memory. tick and time are the caller's.
  void snapshot(scene::Snapshot&) const;

  // The first object whose state is not finite, if any.
  std::optional<scene::ObjectId> first_not_finite() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace smartsurf::world

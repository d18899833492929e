// The physics of one experiment: rigid objects on the field of cells, in fixed time steps.
//
// Two implementations: the native engine (NativeEngine.h), and Bullet as the reference
// (bullet/BulletEngine.h), which bullet/EngineFactory.h chooses from. Equal inputs give bit-identical results
// within one engine, for any number of threads. The object itself is not thread-safe.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/state/StateArchive.h"
#include "smartsurf/scene/ObjectState.h"
#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/scene/Snapshot.h"
#include "smartsurf/surface/Field.h"
#include "smartsurf/surface/actuators/BodyForces.h"

namespace smartsurf::world {

// A contact point of the last step.
struct ContactPoint {
  Eigen::Vector3f point, normal;         // world frame
  float impulse;                         // along the normal over the step, mass·u/s
  scene::ObjectId object;                // the normal points towards it
  std::optional<scene::ObjectId> other;  // absent: a cell or the ground
};

class Engine {
 public:
  Engine() = default;
  virtual ~Engine() = default;
  Engine(const Engine&) = delete;
  Engine& operator=(const Engine&) = delete;

  // Recordings store both. name() is a value of `world.engine`.
  virtual std::string name() const = 0;
  virtual std::string version() const = 0;

  // Adds an object and returns its id: 0, 1, …, never reused.
  virtual scene::ObjectId add(const scene::ObjectSpec&) = 0;

  // These return false and do nothing if the object is not alive.
  virtual bool alive(scene::ObjectId) const = 0;
  virtual bool remove(scene::ObjectId) = 0;
  // Sets the values that are present and keeps the others. Wakes the object and its neighbours.
  virtual bool set_state(scene::ObjectId, const scene::ObjectStateUpdate&) = 0;
  // Applies a constant force (world frame, mass·u/s²) during the next `duration_s` of simulated time, for at
  // least one step. It acts at `point`, given in the world frame and fixed to the body from then on, or at
  // the centre of mass.
  virtual bool apply_force(scene::ObjectId, const Eigen::Vector3d& force,
                           const std::optional<Eigen::Vector3d>& point, double duration_s) = 0;
  // The object must be alive.
  virtual scene::ObjectState state(scene::ObjectId) const = 0;

  // Adds a joint between live objects and returns its id: 0, 1, …, never reused. It goes when either object
  // does. Wakes the objects, as the functions below do.
  virtual scene::JointId add_joint(const scene::JointSpec&) = 0;
  virtual bool has_joint(scene::JointId) const = 0;
  // The joint must exist; set_motor() and set_spring() need a hinge or slider.
  virtual void remove_joint(scene::JointId) = 0;
  virtual void set_motor(scene::JointId, const scene::JointMotor&) = 0;
  virtual void set_spring(scene::JointId, const scene::JointSpring&) = 0;
  virtual scene::JointState joint_state(scene::JointId) const = 0;

  // The live objects, for actuators, extrapolated with their velocities to the mean start time of the next
  // step's substeps, so that an oscillation in a force field keeps its energy. Valid until the next step or
  // until objects are added, removed or their states set.
  virtual surface::BodyView bodies() const = 0;
  // External force and torque on each body during the next step, in the order of bodies(); reset to zero
  // after it. A nonzero wrench wakes its body.
  virtual std::span<surface::Wrench> wrenches() = 0;

  // Advances by one time step. Reads the field's heights and planned velocities; writes Field::impulse and
  // lowers Field::speed of cells that yield under their force limit. The caller commits the field afterwards.
  virtual void step() = 0;
  // From now on Field::impulse may be that of an earlier step until write_impulses() is called. Finding the
  // loads under many flat objects takes a twentieth of a step.
  virtual void write_impulses_when_asked() {}
  virtual void write_impulses() {}

  // The contacts with a positive normal impulse, those of sleeping bodies included. Allocates.
  virtual std::vector<ContactPoint> contacts() const = 0;
  // Number of sleeping bodies: at rest on cells that do not move, hence not simulated.
  virtual int sleeping_count() const = 0;

  // Copies object states, field heights, the contact count and the state hash; reuses the vectors' memory.
  // Leaves tick and time to the caller. with_hash: if false, the hash may be left unchanged.
  virtual void snapshot(scene::Snapshot&, bool with_hash = true) const = 0;

  // True if the last step did not take place, because more objects overlap than solids can: memory and time
  // for their contacts would have no bound.
  virtual bool is_overloaded() const { return false; }

  // Saves or restores all state on which the coming steps depend, except the field. `catalogue`: every
  // object ever created, index = id; the engine has those of the first `declared` in common with the one that
  // was saved. Restored, an engine continues with the same bits, for any number of threads. Throws
  // common::UserError if the engine cannot do this.
  virtual void archive(common::StateArchive&, std::span<const scene::ObjectSpec> catalogue,
                       std::size_t declared) = 0;

  // The first object whose state is not finite, if any.
  virtual std::optional<scene::ObjectId> first_non_finite() const = 0;

 protected:
  // For constructors: adds the scene's objects with ids 0, 1, …, and its joints likewise.
  void add_all(const scene::SceneSpec& scene) {
    for (const auto& object : scene.objects) add(object);
    for (const auto& joint : scene.joints) add_joint(joint);
  }
};

}  // namespace smartsurf::world

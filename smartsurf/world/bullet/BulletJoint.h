// A joint as constraints of Bullet. Internal to the Bullet engine.
#pragma once

#include <btBulletDynamicsCommon.h>

#include <Eigen/Geometry>
#include <memory>
#include <optional>

#include "smartsurf/scene/JointSpec.h"

namespace smartsurf::world {

class BulletJoint {
 public:
  // All quantities are in world units. `a` and `b` at the time of creation; b = null: the table. The joint is
  // in `world` as long as it lives; world and bodies must outlive it.
  BulletJoint(scene::JointId, const scene::JointSpec&, btDiscreteDynamicsWorld& world, btRigidBody& a,
              btRigidBody* b);
  ~BulletJoint();

  scene::JointId id() const { return id_; }
  scene::JointKind kind() const { return kind_; }
  bool connects(const btRigidBody& body) const { return a_ == &body || b_ == &body; }
  void set_motor(const scene::JointMotor&);
  void set_spring(const scene::JointSpring&);
  // Once before the substeps of a step, and before and after each.
  void begin_step();
  void begin_substep(double substep_s);
  void end_substep(double substep_s);
  // Means over `step_s`.
  scene::JointState state(double step_s) const;

 private:
  // The free axis is x in the frames of Bullet's constraint, whose first body is the joint's b.
  static constexpr int kAxis = 0;
  int coordinate_index() const { return kind_ == scene::JointKind::kSlider ? kAxis : 3 + kAxis; }
  btTransform frame_of_a() const { return a_->getWorldTransform() * frame_in_a_; }
  btTransform frame_of_b() const {
    return (b_ ? b_->getWorldTransform() : btTransform::getIdentity()) * frame_in_b_;
  }
  void update_equilibrium();
  // The error of the constraint along one of Bullet's axes: 0 to 2 linear, 3 to 5 angular.
  double error_along(int axis) const;
  void add_constraint(btTypedConstraint&, btJointFeedback&, bool collide);
  std::unique_ptr<btGeneric6DofSpring2Constraint> make_constraint() const;

  scene::JointId id_;
  scene::JointKind kind_;
  btDiscreteDynamicsWorld& world_;
  btRigidBody *a_, *b_;
  btTransform frame_in_a_, frame_in_b_;
  // The second one is friction: Bullet has one motor per axis.
  std::unique_ptr<btGeneric6DofSpring2Constraint> constraint_, friction_;
  btGeneric6DofSpring2Constraint* axis_ = nullptr;  // constraint_, if there is a coordinate
  btJointFeedback feedback_, friction_feedback_;
  double coordinate_ = 0.0, effort_impulse_ = 0.0;
  std::optional<double> spring_rest_;
  btVector3 force_impulse_{0, 0, 0};
};

}  // namespace smartsurf::world

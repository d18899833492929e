#include "smartsurf/world/bullet/BulletJoint.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <numbers>
#include <utility>

#include "smartsurf/scene/Axes.h"
#include "smartsurf/world/bullet/BulletShape.h"
#include "smartsurf/world/solver/SpeedLimits.h"

namespace smartsurf::world {
namespace {

constexpr double kErrorReduction = 0.2;  // of a joint's error, in each substep

void set_range(btGeneric6DofSpring2Constraint& c, int first, int count, bool is_free) {
  // A range without width is locked, an inverted one is free.
  for (int i = first; i < first + count; ++i) c.setLimit(i, is_free ? 1.0 : 0.0, is_free ? -1.0 : 0.0);
}

}  // namespace

BulletJoint::BulletJoint(scene::JointId id, const scene::JointSpec& spec, btDiscreteDynamicsWorld& world,
                         btRigidBody& a, btRigidBody* b)
    : id_(id), kind_(spec.kind), world_(world), a_(&a), b_(b) {
  const Eigen::Quaterniond rotation =
      scene::rotation_between(Eigen::Vector3d::UnitX(), spec.axis.normalized());
  const btTransform frame(to_bt(rotation), to_bt(spec.anchor));
  frame_in_a_ = a.getWorldTransform().inverse() * frame;
  frame_in_b_ = b ? b->getWorldTransform().inverse() * frame : frame;
  const bool is_slider = kind_ == scene::JointKind::kSlider, is_ball = kind_ == scene::JointKind::kBall;
  std::unique_ptr<btGeneric6DofSpring2Constraint> c = make_constraint();
  set_range(*c, 0, 3, false);
  set_range(*c, 3, 3, is_ball);
  if (spec.has_coordinate()) {
    axis_ = c.get();
    const int i = coordinate_index();
    if (spec.limits)
      c->setLimit(i, is_slider ? spec.limits->lower : -spec.limits->upper,
                  is_slider ? spec.limits->upper : -spec.limits->lower);
    else
      set_range(*c, i, 1, true);
    if (spec.spring) set_spring(*spec.spring);
    if (spec.motor) set_motor(*spec.motor);
  }
  constraint_ = std::move(c);
  add_constraint(*constraint_, feedback_, spec.collide);
  if (spec.friction == 0.0) return;
  std::unique_ptr<btGeneric6DofSpring2Constraint> brake = make_constraint();
  set_range(*brake, 0, 6, true);
  brake->enableMotor(coordinate_index(), true);
  brake->setTargetVelocity(coordinate_index(), 0.0);
  brake->setMaxMotorForce(coordinate_index(), spec.friction);
  friction_ = std::move(brake);
  add_constraint(*friction_, friction_feedback_, spec.collide);
}

BulletJoint::~BulletJoint() {
  if (friction_) world_.removeConstraint(friction_.get());
  world_.removeConstraint(constraint_.get());
}

std::unique_ptr<btGeneric6DofSpring2Constraint> BulletJoint::make_constraint() const {
  if (!b_) return std::make_unique<btGeneric6DofSpring2Constraint>(*a_, frame_in_a_);
  return std::make_unique<btGeneric6DofSpring2Constraint>(*b_, *a_, frame_in_b_, frame_in_a_);
}

void BulletJoint::add_constraint(btTypedConstraint& constraint, btJointFeedback& feedback, bool collide) {
  constraint.setJointFeedback(&feedback);
  world_.addConstraint(&constraint, !collide);
}

void BulletJoint::set_motor(const scene::JointMotor& motor) {
  const int i = coordinate_index();
  axis_->enableMotor(i, true);
  axis_->setTargetVelocity(i, -motor.speed);
  axis_->setMaxMotorForce(i, motor.max_effort);
}

void BulletJoint::set_spring(const scene::JointSpring& spring) {
  const int i = coordinate_index();
  axis_->enableSpring(i, true);
  axis_->setStiffness(i, spring.stiffness, false);
  axis_->setDamping(i, spring.damping, false);
  spring_rest_ = spring.rest;
  update_equilibrium();
}

// Bullet's hinge angle is the negated coordinate, wrapped to half a turn.
void BulletJoint::update_equilibrium() {
  if (!spring_rest_) return;
  if (kind_ == scene::JointKind::kSlider)
    return axis_->setEquilibriumPoint(coordinate_index(), *spring_rest_);
  constexpr double kTurn = 2.0 * std::numbers::pi;
  axis_->calculateTransforms();
  const double turns = std::round((axis_->getAngle(kAxis) + coordinate_) / kTurn);
  axis_->setEquilibriumPoint(coordinate_index(), kTurn * turns - *spring_rest_);
}

void BulletJoint::begin_step() {
  effort_impulse_ = 0.0;
  force_impulse_.setZero();
}

double BulletJoint::error_along(int axis) const {
  btTranslationalLimitMotor2& linear = *constraint_->getTranslationalLimitMotor();
  const btRotationalLimitMotor2& angular = *constraint_->getRotationalLimitMotor(axis % 3);
  const bool is_linear = axis < 3;
  const double lower = is_linear ? linear.m_lowerLimit[axis] : angular.m_loLimit,
               upper = is_linear ? linear.m_upperLimit[axis] : angular.m_hiLimit;
  if (lower > upper) return 0.0;
  const double at = is_linear ? constraint_->getRelativePivotPosition(axis)
                              : btAdjustAngleToLimits(constraint_->getAngle(axis % 3), lower, upper);
  return std::max({lower - at, at - upper, 0.0});
}

// Bullet's speed of correction is proportional to the error.
void BulletJoint::begin_substep(double substep_s) {
  constraint_->calculateTransforms();
  const auto reduce = [&](std::initializer_list<int> axes) {
    double squared = 0.0;
    for (const int i : axes) squared += std::pow(error_along(i), 2);
    const double share = std::min(kErrorReduction, kMaxJointCorrectionSpeed * substep_s / std::sqrt(squared));
    for (const int i : axes) constraint_->setParam(BT_CONSTRAINT_STOP_ERP, share, i);
  };
  if (kind_ == scene::JointKind::kSlider)
    reduce({kAxis}), reduce({1, 2});
  else
    reduce({0, 1, 2});
  if (kind_ == scene::JointKind::kHinge)
    reduce({3 + kAxis}), reduce({4, 5});
  else
    reduce({3, 4, 5});
}

void BulletJoint::end_substep(double substep_s) {
  const btTransform a = frame_of_a(), b = frame_of_b();
  const btVector3 axis = b.getBasis().getColumn(kAxis);
  btVector3 force = feedback_.m_appliedForceBodyB, torque = feedback_.m_appliedTorqueBodyB;
  if (friction_) {
    force += friction_feedback_.m_appliedForceBodyB;
    torque += friction_feedback_.m_appliedTorqueBodyB;
  }
  if (kind_ == scene::JointKind::kSlider) {
    const double effort = axis.dot(force);
    effort_impulse_ += substep_s * effort;
    force -= effort * axis;
    coordinate_ = axis.dot(a.getOrigin() - b.getOrigin());
  } else if (kind_ == scene::JointKind::kHinge) {
    const btVector3 arm = a.getOrigin() - a_->getCenterOfMassPosition();
    effort_impulse_ += substep_s * axis.dot(torque - arm.cross(force));
    const btQuaternion q = b.getRotation().inverse() * a.getRotation();
    const double turned = 2.0 * std::atan2(q.x(), q.w()) - coordinate_;
    coordinate_ += std::remainder(turned, 2.0 * std::numbers::pi);
    update_equilibrium();
  }
  force_impulse_ += substep_s * force;
}

scene::JointState BulletJoint::state(double step_s) const {
  scene::JointState out;
  out.force = to_eigen(force_impulse_) / step_s;
  if (!axis_) return out;
  const btVector3 axis = frame_of_b().getBasis().getColumn(kAxis), at = frame_of_a().getOrigin();
  out.coordinate = coordinate_;
  out.effort = effort_impulse_ / step_s;
  auto velocity_at = [&at](const btRigidBody* body) {
    return body ? body->getVelocityInLocalPoint(at - body->getCenterOfMassPosition()) : btVector3(0, 0, 0);
  };
  auto spin_of = [](const btRigidBody* body) {
    return body ? body->getAngularVelocity() : btVector3(0, 0, 0);
  };
  out.speed = axis.dot(kind_ == scene::JointKind::kSlider ? velocity_at(a_) - velocity_at(b_)
                                                          : spin_of(a_) - spin_of(b_));
  return out;
}

}  // namespace smartsurf::world

// Joints: constraints between two objects, or between an object and the table.
//
// A joint's coordinate is the angle of a hinge (rad) or the displacement of a slider (u), of object a
// relative to b along the axis, 0 where the joint is created. "Effort" is the generalised force on the
// coordinate: a torque (mass·u²/s²) at a hinge, a force (mass·u/s²) at a slider.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>

#include "smartsurf/scene/ObjectState.h"

namespace smartsurf::scene {

// Index in the order of creation; never reused.
using JointId = std::uint32_t;

// The motion that stays free between a and b: the rotation about an axis, the translation along one, all
// rotations, nothing.
enum class JointKind : std::uint8_t { kHinge, kSlider, kBall, kFixed };
inline constexpr const char* kJointKindNames[] = {"hinge", "slider", "ball", "fixed"};

struct JointLimits {
  double lower = 0.0, upper = 0.0;  // of the coordinate, lower ≤ upper; the joint stops there without rebound
};
// Effort −stiffness·(coordinate − rest) − damping·speed.
struct JointSpring {
  double stiffness = 0.0, damping = 0.0, rest = 0.0;  // both ≥ 0
};
// Keeps the coordinate's speed as far as an effort in [−max_effort, max_effort] can.
struct JointMotor {
  double speed = 0.0, max_effort = 0.0;  // max_effort ≥ 0
};

struct JointSpec {
  JointKind kind = JointKind::kHinge;
  ObjectId a = 0;
  std::optional<ObjectId> b = {};         // absent: the table
  Eigen::Vector3d anchor{0.0, 0.0, 0.0};  // world frame, at the time of creation, u
  Eigen::Vector3d axis{0.0, 0.0,
                       1.0};  // of a hinge or slider, world frame, at the time of creation; not zero
  // The next four are of hinges and sliders alone.
  std::optional<JointLimits> limits = {};
  double friction = 0.0;  // Coulomb friction: the greatest effort, ≥ 0
  std::optional<JointSpring> spring = {};
  std::optional<JointMotor> motor = {};
  bool collide = false;  // whether a and b collide as well

  bool has_coordinate() const { return kind == JointKind::kHinge || kind == JointKind::kSlider; }
  template <class Archive>
  void archive(Archive& archive) {
    archive(kind, a, b, anchor, axis, limits, friction, spring, motor, collide);
  }
};

struct JointState {
  double coordinate = 0.0, speed = 0.0;  // both 0 for a joint without coordinate
  double effort = 0.0;  // of spring, motor, friction and limits, mean over the last physics step
  Eigen::Vector3d force{0.0, 0.0,
                        0.0};  // of the joint on a without that effort, world frame, mean over that step
};

// "" or one clause with the field, its value and the constraint, as validate() in SceneSpec.h. Does not check
// that the objects exist.
std::string validate(const JointSpec&);

}  // namespace smartsurf::scene

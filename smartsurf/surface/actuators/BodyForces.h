// The interface between objects and actuators that act at a distance: body states in, wrenches out.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <span>

#include "smartsurf/scene/Snapshot.h"

namespace smartsurf::surface {

// Live objects before a physics step, ascending by id, one entry per object in each span: their velocities,
// and the poses to which these take them by the mean of the times at which the substeps begin, when forces
// act. The physics owns the memory; the spans are valid until its next step.
struct BodyView {
  std::span<const scene::ObjectId> id;
  std::span<const Eigen::Vector3f> position;          // of the origin, u
  std::span<const Eigen::Quaternionf> orientation;    // unit
  std::span<const Eigen::Vector3f> velocity;          // of the origin, u/s
  std::span<const Eigen::Vector3f> angular_velocity;  // rad/s, world frame
  std::span<const float> mass;                        // 0 for an immovable object

  std::size_t size() const { return id.size(); }
};

// Force and torque on one object during the next step, about its origin, in the world frame.
// Actuators add to it; the physics resets it after the step.
struct Wrench {
  Eigen::Vector3f force{0.0F, 0.0F, 0.0F};   // mass·u/s²
  Eigen::Vector3f torque{0.0F, 0.0F, 0.0F};  // mass·u²/s²

  bool is_zero() const { return force.isZero(0.0F) && torque.isZero(0.0F); }
};

}  // namespace smartsurf::surface

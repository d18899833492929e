// The pose and velocity of an object, and a partial update of them.
#pragma once

#include <Eigen/Geometry>
#include <optional>

namespace smartsurf::scene {

struct ObjectState {
  Eigen::Vector3d position{0.0, 0.0, 0.0};  // centre of mass, u
  Eigen::Quaterniond orientation{1.0, 0.0, 0.0, 0.0};
  Eigen::Vector3d velocity{0.0, 0.0, 0.0};          // u/s
  Eigen::Vector3d angular_velocity{0.0, 0.0, 0.0};  // rad/s, world frame
};

// Absent members leave the state unchanged.
struct ObjectStateUpdate {
  std::optional<Eigen::Vector3d> position;
  std::optional<Eigen::Quaterniond> orientation;
  std::optional<Eigen::Vector3d> velocity;
  std::optional<Eigen::Vector3d> angular_velocity;
};

}  // namespace smartsurf::scene

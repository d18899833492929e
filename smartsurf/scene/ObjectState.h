// The identity, pose and velocity of an object, and a partial update of the latter two.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <optional>

namespace smartsurf::scene {

using ObjectId = std::uint32_t;  // starts at 0, in order of creation; not reused after removal

struct ObjectState {
  Eigen::Vector3d position{0.0, 0.0, 0.0};  // of the origin (ObjectSpec), u
  Eigen::Quaterniond orientation{1.0, 0.0, 0.0, 0.0};
  Eigen::Vector3d velocity{0.0, 0.0, 0.0};          // of the origin, u/s
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

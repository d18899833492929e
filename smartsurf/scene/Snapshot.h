// A copy of the visible state of the world at the end of a tick, for sensors, view, recorder and script.
// Holds no pointers into the world.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "smartsurf/scene/ObjectState.h"
#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::scene {

// The state of a cell's mechanism, for drawing. By model ("relative" = divided by the model's maximum):
//   ball         a, b: rotation about x and about y, rad
//   wheels       a, b: rotation of each wheel, rad
//   rotor        a: rotation about its axis, rad
//   tile         level: relative amplitude; of a tilting tile a, b: roll and pitch, rad
//   magnet       level: relative current, in [−1, 1]
//   force_field  a, b, level: relative force along x, y, z, in [−1, 1]
//   delta        a, b: x and y of the tip relative to the radius of its workspace
//   air_jet      level: relative flow; a: direction, rad
struct ActuatorState {
  float a = 0.0F, b = 0.0F, level = 0.0F;
};

// Number of joints in Snapshot::joint_position: those of a delta robot.
inline constexpr std::size_t kMaxJoints = 3;

struct Snapshot {
  std::uint64_t tick = 0;
  double time_s = 0.0;

  // Live objects in ascending order of id. All arrays have one entry per object.
  std::vector<ObjectId> id;
  std::vector<std::array<float, 3>> position;          // of the origin, u
  std::vector<std::array<float, 4>> orientation;       // unit quaternion, x y z w
  std::vector<std::array<float, 3>> velocity;          // u/s
  std::vector<std::array<float, 3>> angular_velocity;  // rad/s, world frame

  // [row][column], row 0 is north.
  std::vector<float> height;                  // z of each cell's top, u; -inf = empty cell
  std::vector<ActuatorState> actuator_state;  // empty if all cells are pins
  // [joint][row][column], u: where the drives of a mechanism with joints hold them; 0 for cells with fewer
  // joints. Empty without joints, and in recordings.
  std::vector<float> joint_position;

  std::vector<float> skin_height;  // [row][column] of nodes, u; empty without a skin

  std::uint32_t contact_count = 0;  // contact points in the last physics step
  std::uint64_t state_hash = 0;     // of all body poses and velocities and all pin heights and speeds

  std::size_t object_count() const { return id.size(); }
};

}  // namespace smartsurf::scene

// The visible state of the world at the end of one tick, copied out of the physics for sensors, view,
// recorder and script. Holds no pointers into the world.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::scene {

using ObjectId = std::uint32_t;  // counts from 0 in the order of creation; never used again after removal

// What a cell's mechanism looks like, for drawing. By model:
//   ball         a, b: turned about x and about y, rad          wheels   a, b: turned, rad
//   rotor        a: turned about its axis, rad                  tile     level: amplitude, of the greatest
//   magnet       level: current, of the greatest, in [−1, 1]
//   force_field  a, b, level: force along x, y, z, of the greatest, in [−1, 1]
//   air_jet      level: flow, of the greatest; a: direction, rad
struct ActuatorState {
  float a = 0.0F, b = 0.0F, level = 0.0F;
};

struct Snapshot {
  std::uint64_t tick = 0;
  double time_s = 0.0;

  // Live objects, ascending by id. All arrays have one entry an object.
  std::vector<ObjectId> id;
  std::vector<std::array<float, 3>> position;          // centre of mass, u
  std::vector<std::array<float, 4>> orientation;       // unit quaternion, x y z w
  std::vector<std::array<float, 3>> velocity;          // u/s
  std::vector<std::array<float, 3>> angular_velocity;  // rad/s, world frame

  // Rows × columns, row-major, row 0 north: z of each cell's top, u; -inf: no cell.
  std::vector<float> height;
  std::vector<ActuatorState> actuator_state;  // the same; empty where every cell is a pin

  std::uint32_t contact_count = 0;  // contact points in the last physics step
  std::uint64_t state_hash = 0;     // of every body's pose and velocities and every pin's height and speed

  std::size_t object_count() const { return id.size(); }
};

}  // namespace smartsurf::scene

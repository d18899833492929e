// What pushes and turns a body through one step.
#pragma once

#include <Eigen/Core>

namespace smartsurf::world {

// A force (mass·u/s²) and a torque about the centre of mass, world axes.
struct Wrench {
  Eigen::Vector3f force{0, 0, 0}, torque{0, 0, 0};
  bool zero() const { return force.isZero(0.0F) && torque.isZero(0.0F); }
};

}  // namespace smartsurf::world

// The rows of a body for the vector kernels: eight floats each, which they load and transpose into lanes.
#pragma once

#include "smartsurf/world/body/Vec.h"

namespace smartsurf::world {

struct alignas(32) BodyVelocity {
  float velocity[3] = {}, inverse_mass = 0;             // u/s
  float angular_velocity[3] = {}, inverse_inertia = 0;  // rad/s; inertia: spheres only
};
// Translation, u, and rotation vector, rad, since the start of the step.
struct alignas(32) DeltaPose {
  float translation[3] = {}, unused = 0;
  float rotation[3] = {}, unused_too = 0;
};
// Inverse inertia tensor in world axes.
struct alignas(32) InverseInertia {
  float xx = 0, yy = 0, zz = 0, xy = 0, xz = 0, yz = 0, unused[2] = {};
};
inline Mat3 to_matrix(const InverseInertia& q) {
  Mat3 m;
  m << q.xx, q.xy, q.xz, q.xy, q.yy, q.yz, q.xz, q.yz, q.zz;
  return m;
}

}  // namespace smartsurf::world

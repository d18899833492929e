// The mechanism of a linear delta robot: three joints that slide vertically, each joined to the tip by an
// arm.
#pragma once

#include <Eigen/Core>
#include <array>

#include "smartsurf/scene/ActuatorSpec.h"

namespace smartsurf::scene {

// The values of `delta.tip.shape`.
enum class DeltaTipShape { kSphere, kRoundedCylinder };

// A delta robot with its defaults filled in. The position of a tip is that of its highest point, u: x and y
// along the table's axes from the cell's centre, z from the cell's base.
struct Delta {
  DeltaTipShape tip_shape;
  double tip_radius, tip_length;  // u; the length of a sphere is its diameter
  // The workspace is an upright cylinder over the cell's centre, u.
  double workspace_radius;
  std::array<double, 2> workspace_z;
  double arm_length;    // u
  double joint_radius;  // horizontal distance of the joints from the cell's centre, u
  // mass·u/s², mass/s², mass/s. Infinite: an unlimited force, a rigid tip.
  double max_force, stiffness, damping;

  // The directions of the joints, rad from east about the cell's centre: the first in the north.
  static const std::array<double, 3> kJointDirections;

  // delta: of the model "delta".
  explicit Delta(const ActuatorSpec& delta);

  bool is_rigid() const;
  bool has_force_limit() const;
  // The deflection of a compliant tip under max_force, u; 0 if rigid. Friction at most doubles it.
  double max_deflection() const;
  // Heights of the joints with the tip there, each relative to that with the tip at {0, 0, 0}, u:
  //   z + √(l² − r²) − √(l² − d²)
  // with the arm's length l, the radius r of the joints and the horizontal distance d of tip and joint.
  // Precondition: the tip is within reach of the arms.
  std::array<double, 3> joint_positions(const Eigen::Vector3d& tip) const;
};

}  // namespace smartsurf::scene

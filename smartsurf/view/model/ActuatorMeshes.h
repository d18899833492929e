// The meshes that actuators are drawn with (ActuatorGeometry.h), of unit size about their origin.
#pragma once

#include <Eigen/Core>
#include <span>

#include "smartsurf/view/model/ActuatorGeometry.h"

namespace smartsurf::view {

// Radius 1; every other of eight fields in the second colour.
TwoColourMesh ball_mesh(int segments);
// A wheel that turns about y: radius 1, width 2; every other sector in the second colour.
TwoColourMesh wheel_mesh(int segments);
// An arrow from −1 to 1 along x, head in the second colour.
TwoColourMesh arrow_mesh();
// A low disc: radius 1, z from 0 to 1; a rim in the second colour.
TwoColourMesh coil_mesh(int segments);
// A ring around a hole in the second colour: outer radius 1, z from 0 to 1.
TwoColourMesh nozzle_mesh(int segments);
// A plume, radius 0.4 at z = 0 in the first colour, 1 at z = 1 in the second; open at both ends.
TwoColourMesh plume_mesh(int segments);
// A box of half edges 1, the middle of its top in the second colour.
TwoColourMesh plate_mesh();
// The convex shape around a few points; what lies on one side of x·y = 0 in the second colour.
TwoColourMesh hull_mesh(std::span<const Eigen::Vector3f> points);

}  // namespace smartsurf::view

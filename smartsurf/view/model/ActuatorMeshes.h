// The meshes of the actuators (ActuatorGeometry.h), of unit size about their origin.
#pragma once

#include <Eigen/Core>
#include <span>

#include "smartsurf/view/model/TwoColourMesh.h"

namespace smartsurf::view {

// A sphere of radius 1; every other one of its eight octants has the accent colour.
TwoColourMesh ball_mesh(int segments);
// A wheel about the y axis: radius 1, width 2; every other one of its eight sectors has the accent colour.
TwoColourMesh wheel_mesh(int segments);
// An arrow along x from −1 to 1; the head has the accent colour.
TwoColourMesh arrow_mesh();
// A disc with a recess: radius 1, z from 0 to 1; the rim has the accent colour.
TwoColourMesh coil_mesh(int segments);
// A ring: outer radius 1, z from 0 to 1; its bore has the accent colour.
TwoColourMesh nozzle_mesh(int segments);
// A plume, open at both ends: radius 0.4 and base colour at z = 0, radius 1 and accent colour at z = 1.
TwoColourMesh plume_mesh(int segments);
// A box of half edges 1; the middle of its top has the accent colour.
TwoColourMesh plate_mesh();
// A solid of revolution about z; outline: radius and z from the top down, u. The part above `shaft_z` has the
// accent colour.
TwoColourMesh turned_mesh(int segments, std::span<const Eigen::Vector2f> outline, float shaft_z);
// An upright prism over a rectangle of these half edges with rounded corners, u; its top, at z = 0, has the
// accent colour.
TwoColourMesh rounded_prism_mesh(int segments, const Eigen::Vector2f& half_edges, float corner_radius,
                                 float depth);
// The convex hull of a few points, O(n⁴); the faces towards one octant have the accent colour.
TwoColourMesh hull_mesh(std::span<const Eigen::Vector3f> points);

}  // namespace smartsurf::view

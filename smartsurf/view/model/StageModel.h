// The stage that both renderers draw around the moving scene: the light, the looks of materials, the ground,
// the board and the axes. No OpenGL.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <vector>

#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/view/model/Camera.h"
#include "smartsurf/view/model/DrawOptions.h"
#include "smartsurf/view/model/PinShading.h"

namespace smartsurf::view {

// Light and background. Lights are linear, backgrounds screen colours.
struct StageLight {
  // The sun's irradiance of a face towards it, divided by π; the radiance of sky and ground.
  std::array<float, 3> sun, sky, bounce;
  float lamps;  // brightness of the lamps that glossy surfaces mirror
  std::array<float, 3> floor_paint;
  float grid;  // 1: darker lines, −1: brighter ones
  std::array<float, 3> horizon, zenith;
};
const StageLight& stage_light(Stage stage);

Eigen::Vector3d towards_sun();  // unit vector
// Radius of the sun, rad. It is a lamp of about ten times the real one's.
inline constexpr double kSunRadius = 0.055;

// Roughness, share of metal, reflectance head-on and pattern.
using Finish = std::array<float, 4>;
inline constexpr float kGrain = 1.0F, kSeeThrough = 2.0F;  // patterns; 0: none
const Finish& finish_of(const scene::SceneSpec& scene, const scene::ObjectSpec& object);
inline constexpr Finish kPlainFinish{0.32F, 0.0F, 0.045F, 0.0F}, kPinFinish{0.5F, 0.0F, 0.04F, 0.0F},
    kActuatorFinish{0.45F, 0.0F, 0.04F, 0.0F};

// The board below the pins, and the coordinate axes.
struct StaticBox {
  Eigen::Vector3d low, high;  // u
  Rgb colour;                 // sRGB
};
std::vector<StaticBox> static_boxes(const scene::SurfaceSpec& surface, bool axes);

// The ground is a square around the table.
double ground_half_edge(const scene::SurfaceSpec& surface);  // u
// Between the lines on the ground, u.
double grid_spacing(const scene::SurfaceSpec& surface);
// Distances from the eye, u, between which the ground fades into the background.
std::array<double, 2> fading_distances(const scene::SurfaceSpec& surface, const Camera& camera);

// The walls that face the camera.
NearWalls near_walls(const Camera& camera);

}  // namespace smartsurf::view

#include "smartsurf/view/model/StageModel.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "smartsurf/view/model/Axes.h"
#include "smartsurf/view/model/TableBounds.h"

namespace smartsurf::view {
namespace {

constexpr StageLight kStages[] = {
    {{0.94f, 0.88f, 0.78f},
     {0.40f, 0.43f, 0.51f},
     {0.24f, 0.225f, 0.21f},
     4.0f,
     {0.56f, 0.57f, 0.585f},
     1.0f,
     {0.80f, 0.81f, 0.825f},
     {0.93f, 0.94f, 0.95f}},
    {{1.04f, 0.96f, 0.84f},
     {0.21f, 0.235f, 0.29f},
     {0.07f, 0.07f, 0.08f},
     4.0f,
     {0.045f, 0.048f, 0.055f},
     -4.0f,
     {0.15f, 0.16f, 0.18f},
     {0.06f, 0.065f, 0.075f}},
};
static_assert(std::size(kStages) == kStageNames.size());

// By scene::kLookNames.
constexpr Finish kFinishes[] = {
    kPlainFinish,
    {0.24f, 1.0f, 0.0f, 0.0f},
    {0.85f, 0.0f, 0.025f, 0.0f},
    {0.14f, 0.0f, 0.06f, 0.0f},
    {0.48f, 0.0f, 0.04f, kGrain},
    {0.10f, 0.0f, 0.05f, kSeeThrough},
};
static_assert(std::size(kFinishes) == scene::kLookNames.size());

constexpr Rgb kBoardColour{0.20f, 0.21f, 0.23f};
constexpr Rgb kAxisColours[3] = {{0.80f, 0.16f, 0.14f}, {0.16f, 0.58f, 0.22f}, {0.14f, 0.32f, 0.82f}};

}  // namespace

const StageLight& stage_light(Stage stage) { return kStages[static_cast<int>(stage)]; }

Eigen::Vector3d towards_sun() { return Eigen::Vector3d(-0.52, -0.30, 0.80).normalized(); }

const Finish& finish_of(const scene::SceneSpec& scene, const scene::ObjectSpec& object) {
  const std::size_t material = object.material;
  return kFinishes[material < scene.materials.size() ? scene.materials[material].look : 0];
}

std::vector<StaticBox> static_boxes(const scene::SurfaceSpec& surface, bool with_axes) {
  const Eigen::AlignedBox3d box = surface_bounding_box(surface);
  const double margin = kBoardMargin * surface.pitch, thickness = 0.12 * surface.pitch;
  const Eigen::Vector3d low = box.min() - Eigen::Vector3d(margin, margin, 0.0);
  std::vector<StaticBox> boxes{
      {low, {box.max().x() + margin, box.max().y() + margin, low.z() + thickness}, kBoardColour}};
  if (!with_axes) return boxes;
  const Axes axes = make_axes(surface);
  const Eigen::Vector3d half = Eigen::Vector3d::Constant(axes.half_width);
  for (int i = 0; i < 3; ++i)
    boxes.push_back(
        {axes.origin - half, axes.origin + half + axes.length * Eigen::Vector3d::Unit(i), kAxisColours[i]});
  return boxes;
}

double ground_half_edge(const scene::SurfaceSpec& surface) {
  return 20.0 * surface_bounding_box(surface).diagonal().norm();
}

// One line every 1, 10, 100 … pitches, so that about ten lines cross the table.
double grid_spacing(const scene::SurfaceSpec& surface) {
  const double cells = std::max(surface.rows, surface.columns);
  return surface.pitch * std::pow(10.0, std::max(0.0, std::round(std::log10(cells / 6.0))));
}

std::array<double, 2> fading_distances(const scene::SurfaceSpec& surface, const Camera& camera) {
  const double radius = 0.5 * surface_bounding_box(surface).diagonal().norm();
  return {camera.distance() + 1.5 * radius, camera.distance() + 9.0 * radius};
}

NearWalls near_walls(const Camera& camera) {
  constexpr double kFacing = 0.3;  // of the component of the viewing direction that faces a wall
  const Eigen::Vector3d forward = camera.forward();
  return {forward.x() > kFacing, forward.x() < -kFacing, forward.y() > kFacing, forward.y() < -kFacing};
}

}  // namespace smartsurf::view
